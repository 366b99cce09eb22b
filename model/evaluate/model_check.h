// Whether a model's weights do what they should, at a glance: an object that needs no file is reconstructed, and its
// input views are drawn again.
#pragma once
#include <string>
#include <vector>

#include "model/networks/network.h"

namespace vsplat {

// PSNR in dB on white, at the model's size, drawn values clamped to [0,1].
struct CheckedView {
  std::string name;
  double psnr = 0;          // of what is drawn from this input's camera, against the input
  double psnr_nearest = 0;  // of the other input nearest by angle
};

struct ModelCheck {
  std::string object;
  std::vector<CheckedView> views;
  double psnr = 0, psnr_nearest = 0;  // the views' means
  long gaussians = 0;

  // What was put in would have been a better answer than what came out: the weights are untrained, damaged or read
  // wrongly. Where a number is NaN, too.
  bool is_below_nearest() const { return !(psnr > psnr_nearest); }
};

// Of a random object, the same for every model, in as many views as the network is trained with, but at least two, as
// an evaluation chooses them. Waits.
ModelCheck check_model(Context& ctx, const Network& network, const ForwardOptions& options);

}  // namespace vsplat

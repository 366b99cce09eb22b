// A quick check of a model's weights: reconstructs an object that needs no file, and renders its input views again.
#pragma once
#include <string>
#include <vector>

#include "model/networks/network.h"

namespace vsplat {

// PSNR in dB on white, at the model's size; renderings are clamped to [0,1].
struct CheckedView {
  std::string name;
  double psnr = 0;          // of the rendering from this input's camera
  double psnr_nearest = 0;  // of the nearest other input by angle
};

struct ModelCheck {
  std::string object;
  std::vector<CheckedView> views;
  double psnr = 0, psnr_nearest = 0;  // the views' means
  long gaussians = 0;

  // True if the inputs themselves are a better answer than the renderings, or if a score is NaN: the weights are
  // untrained, damaged or read wrongly.
  bool is_below_nearest() const { return !(psnr > psnr_nearest); }
};

// Checks with a random object, the same for every model, in as many views as the network is trained with, but at least
// two, chosen as in an evaluation. Waits for the device.
ModelCheck check_model(Context& ctx, const Network& network, const ForwardOptions& options);

}  // namespace vsplat

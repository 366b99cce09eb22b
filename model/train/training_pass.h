// One object of a training step: the network, both levels drawn in every view, the loss, and all the way back.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/networks/network.h"
#include "model/ops/fit/surface_loss.h"

namespace vsplat {

// `cameras.size()` views in the object's frame, the first of which the network sees.
struct PassViews {
  Tensor inputs;                                  // [V, S, S, 3] in [0,1]
  std::vector<Camera> cameras;                    // V input views, then others; S x S
  std::vector<Camera> given;                      // what the network is told of the V, noise and all; empty: the same
  std::vector<Camera> drawn;                      // what the loss's pictures are drawn by; empty: `cameras`
  std::vector<Tensor> targets;                    // [1, S, S, 3] each, of the size that is drawn
  std::vector<std::array<float, 3>> backgrounds;  // that a view is drawn over
  std::vector<Tensor> rgba;  // u8 [S, S, 4] each, as PictureTarget has them, or none; empty: of no view. As targets
  long input_views() const { return inputs.dim(0); }
};

struct PassOptions {
  ForwardOptions forward;
  bool recompute = false;  // of most stages the inputs alone are kept, and backward runs each once more: the same bits
  float ssim_weight = 0.5f;
  SurfaceWeights surface;  // of surfels' coarse level
  float alpha_weight = 0;  // of the mean absolute error of alpha, in views with `rgba`; in the gradients alone
  float scale = 1;         // of the gradients: the object's share in a step
  // A plan without drawing, which makes room for itself as soon as it knows what it draws.
  bool network_alone = false;
  // In a plan: Error(memory) where a picture would have to be drawn in parts.
  bool whole = false;
  // What a plan takes a picture's intersections of Gaussians with tiles for, at the most all that there can be; eight
  // for each Gaussian where it is none.
  std::optional<std::uint64_t> assumed_intersections;
};

// f32 [3] on the device for each view: the loss, the mean squared error, the similarity.
using LevelLoss = std::vector<Tensor>;

struct PassResult {
  LevelLoss coarse, final;          // `final` is empty where there is one level
  Tensor rays;                      // [1]: the mean squared error of predicted rays; none where they are not predicted
  long selected = 0;                // as the network selects
  std::uint64_t intersections = 0;  // the most in a picture
};

// A pass in three parts, since what memory the second takes is known after the first. The coarse half of the network:
Network::Half begin_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options);

// As far as the backward through the network: no gradient by a weight has changed yet.
struct DrawnPass {
  PassResult result;
  Network::Trained trained;
  GaussianGradients dcoarse, dfinal;
  Tensor drays;  // of the ray loss alone, by predicted rays
};
DrawnPass draw_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options,
                    Network::Half half);

PassResult finish_pass(Context& ctx, const Network& network, DrawnPass pass);

// All three. Adds the loss's gradients to those of the weights that `network` was made from. The loss is the sum over
// the levels of the mean over views of MSE + ssim_weight (1 - SSIM), of the surface's terms, and where poses are
// predicted of share_loss_weight times the rays' error; times `scale` in the gradients alone; those have alpha_weight's
// part, too. The same bits every time.
PassResult training_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options);

}  // namespace vsplat

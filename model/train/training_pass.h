// One object of a training step: the network, both levels rendered in every view, the loss, and the backward pass.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/networks/network.h"
#include "model/ops/fit/surface_loss.h"

namespace vsplat {

// `cameras.size()` views in the object's frame. The network sees the first V.
struct PassViews {
  Tensor inputs;                // [V, S, S, 3] in [0,1]
  std::vector<Camera> cameras;  // V input views, then the others; S x S
  std::vector<Camera> given;    // the V poses that the network receives, including noise; empty: the exact ones
  std::vector<Camera> drawn;    // cameras of the loss's pictures; empty: `cameras`
  std::vector<Tensor> targets;  // [1, S, S, 3] each, at the rendered size
  std::vector<std::array<float, 3>> backgrounds;  // of each view
  // u8 [S, S, 4] each, at the targets' size, as in PictureTarget, or empty; no elements: no view has one
  std::vector<Tensor> rgba;
  long input_views() const { return inputs.dim(0); }
};

struct PassOptions {
  ForwardOptions forward;
  bool recompute = false;  // store only the inputs of most stages and run each again in backward: the same bits
  float ssim_weight = 0.5f;
  SurfaceWeights surface;     // for a coarse level of surfels
  float alpha_weight = 0;     // of alpha's mean absolute error, in views with `rgba`; affects only the gradients
  float sparsity_weight = 0;  // of the mean of ln(1 + opacity / 0.05), for each level; affects only the gradients
  float scale = 1;            // of the gradients: the object's share of a step
  // A plan without rendering, which reserves its own memory once the number of Gaussians is known.
  bool network_alone = false;
  // In a plan: Error(memory) if a picture would have to be rendered in tiles.
  bool whole = false;
  // Intersections of Gaussians and tiles that a plan assumes in a picture, limited to the possible maximum. Default:
  // eight for each Gaussian.
  std::optional<std::uint64_t> assumed_intersections;
};

// One tensor per view, f32 [3] on the device: the loss, the mean squared error, the similarity.
using LevelLoss = std::vector<Tensor>;

struct PassResult {
  LevelLoss coarse, final;          // empty if there is one level
  Tensor rays;                      // [1]: the mean squared error of predicted rays; empty if rays are not predicted
  long selected = 0;                // as the network counts it
  std::uint64_t intersections = 0;  // maximum over pictures
};

// A pass has three calls, since the second one's memory is known only after the first. The coarse half of the network:
Network::Half begin_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options);

// The state before the network's backward; no gradient of a weight has changed yet.
struct DrawnPass {
  PassResult result;
  Network::Trained trained;
  GaussianGradients dcoarse, dfinal;
  Tensor drays;  // gradient of the ray loss by the predicted rays
};
DrawnPass draw_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options,
                    Network::Half half);

PassResult finish_pass(Context& ctx, const Network& network, DrawnPass pass);

// All three calls. Adds the loss's gradients to those of the weights that `network` was made from. The loss is the sum
// over levels of the mean over views of MSE + ssim_weight (1 - SSIM), plus the surface terms, plus, if poses are
// predicted, share_loss_weight times the rays' error. The gradients are also multiplied by `scale` and include
// the terms of alpha_weight and sparsity_weight. Deterministic to the bit.
PassResult training_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options);

}  // namespace vsplat

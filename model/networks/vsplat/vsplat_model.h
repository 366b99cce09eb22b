// VS-Splat's whole network: from posed pictures to Gaussians. `forward` follows the paper's figure: encoder,
// modulation, lifting, volume network, coarse heads, selection; then, at the selected voxels only, projection,
// refinement, fine heads and adjustor.
#pragma once
#include <memory>
#include <vector>

#include "model/base/device_cameras.h"
#include "model/base/gaussians.h"
#include "model/networks/layers/forward_options.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"
#include "runtime/context.h"

namespace vsplat {

struct ForwardResult {
  DeviceGaussians coarse;     // one per voxel, with refined opacity
  DeviceGaussians final;      // M P fine ones voxel by voxel, then P adjusted skeletal ones (fewer for other `levels`)
  std::vector<int> selected;  // voxel indices (i R + j) R + k, ascending
  Tensor refined;             // [P, fine_dim]: the selected voxels' features; empty unless `levels` is "fine"
  Tensor rays;                // [V, t, t, 6] if poses are predicted
};

class VsplatModel {
 public:
  // Uploads and repacks the weights for the context's device and flavour.
  VsplatModel(Context& ctx, const Config& config, const WeightSource& weights);
  ~VsplatModel();

  const Config& config() const { return config_; }

  // images [V,S,S,3] in [0,1], composited; cameras in the object's frame. Plans and reserves the memory of each half
  // before it runs, and throws Error(memory) if it does not fit: before the start for `planned_selected`, after the
  // selection for the actual count.
  ForwardResult forward(Context& ctx, const Tensor& images, const DeviceCameras& cameras,
                        const ForwardOptions& options) const;

  // A training's forward, in two calls, since the second one's memory is known only after the first. Both keep what
  // backward needs, and plan no memory; `ctx` may be a planner.
  struct Coarse;
  struct Saved;
  struct CoarseHalf {
    long selected = 0;  // voxels; 0 if `levels` is "coarse"
    DeviceCameras cameras;
    std::shared_ptr<Coarse> coarse;
    std::shared_ptr<Saved> saved;
  };
  struct Trained {
    DeviceGaussians coarse, final;
    Tensor selected;               // i32 [P]; empty if `levels` is "coarse"
    Tensor refined;                // as in ForwardResult
    Tensor rays;                   // [V, t, t, 6] if poses are predicted
    std::shared_ptr<Saved> saved;  // consumed by backward
  };
  // `recompute`: stores only the inputs of most stages; backward runs each stage once more before its own. Gives the
  // same bits with less memory.
  CoarseHalf coarse_in_training(Context& ctx, const Tensor& images, const DeviceCameras& cameras,
                                const ForwardOptions& options, bool recompute) const;
  Trained fine_in_training(Context& ctx, CoarseHalf half, const ForwardOptions& options) const;
  // Takes the gradients by the coarse and the final Gaussians; adds those by the weights to LearntWeights'. Consumes
  // `dcoarse`. `dfinal` is empty if `levels` is "coarse", which has one level. `drefined`: by the refined features, if
  // something else depends on them. `drays`: by predicted rays, if there are any; consumed, too; empty: zeros.
  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const Tensor& drefined = {}, Tensor drays = {}) const;

  // Memory that forward needs for so many views. `ctx` may be a planner.
  MemoryPlan plan(const Context& ctx, long views, long selected) const;

  // The same for a model that is not loaded yet, including its weights; allocates nothing.
  static MemoryPlan plan(const Context& ctx, const Config& config, const Weights& weights, long views, long selected);

  // Upper bound: the number of Gaussians if every voxel is selected.
  static long most_gaussians(const Config& config);

 private:
  struct Modules;
  Coarse coarse(Context& ctx, const Tensor& images, const DeviceCameras& cameras, const ForwardOptions& options,
                Saved* saved) const;
  DeviceGaussians fine(Context& ctx, const Coarse& state, const DeviceCameras& cameras, const ForwardOptions& options,
                       Saved* saved, Tensor* refined = nullptr) const;
  // Store the inputs of either half, if backward will run its stages again.
  void hold_coarse_inputs(Saved& saved, const Tensor& images, const DeviceCameras& cameras, const Coarse& state) const;
  void hold_fine_inputs(Saved& saved, const Coarse& state, const DeviceGaussians& skeleton) const;
  // Takes the gradients by the final Gaussians, or the skeletal ones; adds to those by the coarse half's results.
  void fine_backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                     const Tensor& drefined, const Tensor& dvolume, const Tensor& dfeatures) const;

  Config config_;
  std::unique_ptr<Modules> modules_;
};

}  // namespace vsplat

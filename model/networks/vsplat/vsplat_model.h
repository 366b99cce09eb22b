// The network, whole: posed pictures in, Gaussians out. `forward` is the paper's figure: encoder, modulation, lifting,
// volume network, coarse heads, selection, then, at the selected voxels only, projection, refinement, fine heads and
// adjustor.
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
  DeviceGaussians final;      // M P fine ones voxel by voxel, then P adjusted skeletal ones (or what `levels` says)
  std::vector<int> selected;  // voxel indices (i R + j) R + k, ascending
  Tensor refined;             // [P, fine_dim]: the selected voxels' features; none where `levels` is not "fine"
  Tensor rays;                // [V, t, t, 6], where poses are predicted
};

class VsplatModel {
 public:
  // Uploads and repacks the weights for the context's device and flavour.
  VsplatModel(Context& ctx, const Config& config, const WeightSource& weights);
  ~VsplatModel();

  const Config& config() const { return config_; }

  // images [V,S,S,3] in [0,1], composited; cameras in the object's frame. Plans and reserves the memory of each half
  // before it runs, and refuses (Error(memory)) what does not fit: before the start at `planned_selected`, after the
  // selection at the true count.
  ForwardResult forward(Context& ctx, const Tensor& images, const DeviceCameras& cameras,
                        const ForwardOptions& options) const;

  // A training's forward, in two calls: what memory the second takes is known after the first. Both keep what backward
  // needs, and plan no memory; `ctx` may be a planner.
  struct Coarse;
  struct Saved;
  struct CoarseHalf {
    long selected = 0;  // voxels; 0 where `levels` is "coarse"
    DeviceCameras cameras;
    std::shared_ptr<Coarse> coarse;
    std::shared_ptr<Saved> saved;
  };
  struct Trained {
    DeviceGaussians coarse, final;
    Tensor selected;               // i32 [P]; none where `levels` is "coarse"
    Tensor refined;                // as ForwardResult has it
    Tensor rays;                   // [V, t, t, 6], where poses are predicted
    std::shared_ptr<Saved> saved;  // backward takes it apart as it goes
  };
  // `recompute`: of most stages the inputs alone are kept, and backward runs each once more before its own: the same
  // bits from less memory.
  CoarseHalf coarse_in_training(Context& ctx, const Tensor& images, const DeviceCameras& cameras,
                                const ForwardOptions& options, bool recompute) const;
  Trained fine_in_training(Context& ctx, CoarseHalf half, const ForwardOptions& options) const;
  // From gradients by the coarse and the final Gaussians to those by the weights, which are added to LearntWeights'.
  // `dcoarse` is used up. `dfinal` is none where `levels` is "coarse": there is one level. `drefined`: by the refined
  // features, where something else depends on them. `drays`, by predicted rays alone, is used up, too; none: zeros.
  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const Tensor& drefined = {}, Tensor drays = {}) const;

  // What forward would take for so many views. `ctx` may be a planner.
  MemoryPlan plan(const Context& ctx, long views, long selected) const;

  // The same for a model not loaded yet, weights included; nothing is allocated.
  static MemoryPlan plan(const Context& ctx, const Config& config, const Weights& weights, long views, long selected);

  // No voxel can take more: every voxel selected, as a Gaussian count.
  static long most_gaussians(const Config& config);

 private:
  struct Modules;
  Coarse coarse(Context& ctx, const Tensor& images, const DeviceCameras& cameras, const ForwardOptions& options,
                Saved* saved) const;
  DeviceGaussians fine(Context& ctx, const Coarse& state, const DeviceCameras& cameras, const ForwardOptions& options,
                       Saved* saved, Tensor* refined = nullptr) const;
  // What either half is run from once more, where its stages do not keep what backward needs.
  void hold_coarse_inputs(Saved& saved, const Tensor& images, const DeviceCameras& cameras, const Coarse& state) const;
  void hold_fine_inputs(Saved& saved, const Coarse& state, const DeviceGaussians& skeleton) const;
  // From the final Gaussians, or the skeletal ones, to what the coarse half gave; all added to.
  void fine_backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                     const Tensor& drefined, const Tensor& dvolume, const Tensor& dfeatures) const;

  Config config_;
  std::unique_ptr<Modules> modules_;
};

}  // namespace vsplat

// LaRa's network, whole: posed pictures in, surfels (or, as GenDen's backbone, Gaussians) out. Encoder, modulation,
// lifting, volume transformer, coarse decoder; the coarse primitives are drawn in the input views; those that are not
// transparent get finer colours from what photographs and drawings show at their places.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/gaussians.h"
#include "model/networks/layers/forward_options.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/lara_config.h"
#include "model/ops/networks/view_maps.h"
#include "model/render/render.h"
#include "runtime/context.h"

namespace vsplat {

// Draws the coarse primitives in an input view, over white: [1, S, S, ..], depth accumulated.
using DrawView = std::function<ViewDrawings(Context&, const DeviceGaussians&, const Camera&)>;

struct LaraOptions {
  DrawView draw;                       // none: draw_view() below
  const ViewDrawings* held = nullptr;  // of all views, used instead of drawing; their depth is divided by alpha already
  long planned_kept = 0;               // primitives that a plan takes for kept
  bool fine = true;                    // in a training, with the final primitives
  // As ForwardOptions has them.
  std::function<void(const std::string&, const Tensor&)> tap;
  std::function<void(const std::string& stage, double done)> progress;
};

struct LaraResult {
  DeviceGaussians coarse;  // K of each of the (2R)^3 voxels
  DeviceGaussians final;   // the P of them that are kept, with their finer colours
  Tensor features;         // [P, F], what the fine decoder gives beside colours; none where F = 0
  std::vector<int> kept;   // which: ascending
  Tensor index;            // i32 [P]: the same on the device
  Tensor volume;           // [(2R)^3, out_ch]: primitive / K is its voxel
};

// Gradients by what a result tells beside primitives; none where nothing depends on it.
struct LaraFeatureGradients {
  Tensor features;  // [P, F]
  Tensor voxels;    // [P, out_ch], by the volume's rows of the kept ones
};

// By model/render's renderer, as the configuration says.
RenderOptions drawing_of(const LaraConfig& config);
DrawView draw_view(const LaraConfig& config);

class LaraModel {
 public:
  // Uploads and repacks the weights for the context's device and flavour.
  LaraModel(Context& ctx, const LaraConfig& config, const WeightSource& weights);
  ~LaraModel();

  const LaraConfig& config() const { return config_; }

  // images [V,S,S,3] in [0,1], on white; cameras in the object's frame, 1 to view_slots of them: Error(usage) names the
  // field where there are more. Plans and reserves the memory of each half before it runs, as VsplatModel does.
  LaraResult forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                     const LaraOptions& options) const;

  // A training's forward, in two calls, which plan no memory; both keep what backward needs.
  struct Coarse;
  struct Saved;
  struct CoarseHalf {
    long kept = 0;  // primitives
    std::shared_ptr<Coarse> coarse;
    std::shared_ptr<Saved> saved;
  };
  struct Trained {
    LaraResult result;             // without final ones where LaraOptions::fine is not set
    std::shared_ptr<Saved> saved;  // backward takes it apart as it goes
  };
  // `recompute`: of most stages the inputs alone are kept, and backward runs each once more before its own.
  CoarseHalf coarse_in_training(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                                const LaraOptions& options, bool recompute) const;
  Trained fine_in_training(Context& ctx, CoarseHalf half, const LaraOptions& options) const;
  // From gradients by the coarse and the final primitives to those by the weights, which are added to LearntWeights'.
  // `dcoarse` is used up. `dfinal` without tensors: nothing depends on the final ones; else the coarse ones are drawn
  // once more, for what the final colours owe to them. Drawings that LaraOptions gave are constants.
  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const LaraFeatureGradients& by = {}) const;

  // What forward would take for so many views and kept primitives. `ctx` may be a planner.
  MemoryPlan plan(const Context& ctx, long views, long kept) const;
  // The same for a model not loaded yet, weights included; nothing is allocated.
  static MemoryPlan plan(const Context& ctx, const LaraConfig& config, const Weights& weights, long views, long kept);

 private:
  struct Modules;
  Coarse coarse(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const LaraOptions& options,
                Saved* saved) const;
  LaraResult fine(Context& ctx, const Coarse& state, const LaraOptions& options, Saved* saved) const;
  Tensor draw(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const DeviceGaussians& coarse,
              const LaraOptions& options) const;
  // From the maps that the fine decoder sampled, through the drawings, to the coarse primitives, added to.
  void drawings_backward(Context& ctx, const Saved& saved, const Tensor& dmaps, const GaussianGradients& dcoarse) const;
  // What the stages are run from once more, where they do not keep what backward needs.
  void hold_inputs(Saved& saved, const Tensor& images, const Coarse& state) const;

  LaraConfig config_;
  std::unique_ptr<Modules> modules_;
};

}  // namespace vsplat

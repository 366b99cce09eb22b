// LaRa's whole network: from posed pictures to surfels (or Gaussians, as GenDen's backbone). Encoder, modulation,
// lifting, volume transformer and coarse decoder make coarse primitives. These are rendered in the input views. Those
// that are not transparent get finer colours from the photographs and the renderings at their positions.
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

// Renders the coarse primitives in an input view, over white: [1, S, S, ..], with accumulated depth.
using DrawView = std::function<ViewDrawings(Context&, const DeviceGaussians&, const Camera&)>;

struct LaraOptions {
  DrawView draw;  // empty: draw_view() below
  // renderings of all views to use instead; their depth is already divided by alpha
  const ViewDrawings* held = nullptr;
  long planned_kept = 0;  // kept primitives that a plan assumes
  bool fine = true;       // in training: whether to compute the final primitives
  // As in ForwardOptions.
  std::function<void(const std::string&, const Tensor&)> tap;
  std::function<void(const std::string& stage, double done)> progress;
};

struct LaraResult {
  DeviceGaussians coarse;  // K per voxel of the (2R)^3
  DeviceGaussians final;   // the P kept ones, with finer colours
  Tensor features;         // [P, F], the fine decoder's features besides the colours; empty if F = 0
  std::vector<int> kept;   // indices of the kept ones, ascending
  Tensor index;            // i32 [P]: the same indices on the device
  Tensor volume;           // [(2R)^3, out_ch]: primitive / K is its voxel
};

// Gradients by a result's features; empty if nothing depends on them.
struct LaraFeatureGradients {
  Tensor features;  // [P, F]
  Tensor voxels;    // [P, out_ch], by the kept primitives' rows of the volume
};

// Options and function for the renderer of model/render, from the configuration.
RenderOptions drawing_of(const LaraConfig& config);
DrawView draw_view(const LaraConfig& config);

class LaraModel {
 public:
  // Uploads and repacks the weights for the context's device and flavour.
  LaraModel(Context& ctx, const LaraConfig& config, const WeightSource& weights);
  ~LaraModel();

  const LaraConfig& config() const { return config_; }

  // images [V,S,S,3] in [0,1], on white. cameras in the object's frame, 1 to view_slots: for more, Error(usage) names
  // the field. Plans and reserves the memory of each half before it runs, like VsplatModel.
  LaraResult forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                     const LaraOptions& options) const;

  // A training's forward, in two calls, which plan no memory. Both keep what backward needs.
  struct Coarse;
  struct Saved;
  struct CoarseHalf {
    long kept = 0;  // primitives
    std::shared_ptr<Coarse> coarse;
    std::shared_ptr<Saved> saved;
  };
  struct Trained {
    LaraResult result;             // without final primitives if LaraOptions::fine is false
    std::shared_ptr<Saved> saved;  // consumed by backward
  };
  // `recompute`: stores only the inputs of most stages; backward runs each stage once more.
  CoarseHalf coarse_in_training(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                                const LaraOptions& options, bool recompute) const;
  Trained fine_in_training(Context& ctx, CoarseHalf half, const LaraOptions& options) const;
  // Takes the gradients by the coarse and the final primitives; adds those by the weights to LearntWeights'. Consumes
  // `dcoarse`. `dfinal` without tensors: nothing depends on the final primitives. Otherwise the coarse ones are
  // rendered once more, for the gradient of the final colours through the renderings. Renderings given in LaraOptions
  // are constants.
  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const LaraFeatureGradients& by = {}) const;

  // Memory that forward needs for so many views and kept primitives. `ctx` may be a planner.
  MemoryPlan plan(const Context& ctx, long views, long kept) const;
  // The same for a model that is not loaded yet, including its weights; allocates nothing.
  static MemoryPlan plan(const Context& ctx, const LaraConfig& config, const Weights& weights, long views, long kept);

 private:
  struct Modules;
  Coarse coarse(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const LaraOptions& options,
                Saved* saved) const;
  LaraResult fine(Context& ctx, const Coarse& state, const LaraOptions& options, Saved* saved) const;
  Tensor draw(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const DeviceGaussians& coarse,
              const LaraOptions& options) const;
  // Takes the gradient by the maps that the fine decoder sampled; adds those by the coarse primitives, through the
  // renderings.
  void drawings_backward(Context& ctx, const Saved& saved, const Tensor& dmaps, const GaussianGradients& dcoarse) const;
  // Stores the inputs of the stages that backward will run again.
  void hold_inputs(Saved& saved, const Tensor& images, const Coarse& state) const;

  LaraConfig config_;
  std::unique_ptr<Modules> modules_;
};

}  // namespace vsplat

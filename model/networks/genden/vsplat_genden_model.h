// VS-Splat's network followed by the densifier. The candidates are its final Gaussians, fine and skeletal, that are not
// transparent; each has the refined feature of its voxel.
#pragma once
#include <memory>
#include <vector>

#include "model/networks/genden/densifier.h"
#include "model/networks/params/vsplat_genden_config.h"
#include "model/networks/vsplat/vsplat_model.h"

namespace vsplat {

struct VsplatGendenOptions {
  ForwardOptions backbone;  // its tap and progress serve the whole network
  CurveOrders orders;       // empty: random_orders() of the seed
  std::uint64_t seed = 0;
  const Tensor* score = nullptr;  // [N], replaces the screen-space scores
};

struct VsplatGendenResult {
  DeviceGaussians coarse;     // VS-Splat's coarse Gaussians
  DeviceGaussians base;       // VS-Splat's final Gaussians, N = (M + 1) P
  DeviceGaussians final;      // the new ones, then the candidates that were not replaced
  std::vector<int> selected;  // voxels
  Tensor rays;                // [V, t, t, 6] if poses are predicted
};

class VsplatGendenModel {
 public:
  // Uploads and repacks the weights for the context's device and flavour.
  VsplatGendenModel(Context& ctx, const VsplatGendenConfig& config, const WeightSource& weights);

  const VsplatGendenConfig& config() const { return config_; }

  // As VsplatModel::forward.
  VsplatGendenResult forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                             const VsplatGendenOptions& options) const;

  // A training's forward, in two halves or in one, and its backward, as in VsplatModel. The scores are constants for
  // the gradient. `drays` is used only with predicted rays.
  struct Dense;
  struct Trained {
    DeviceGaussians final;
    VsplatModel::Trained backbone;
    std::shared_ptr<Dense> dense;
  };
  VsplatModel::CoarseHalf coarse_in_training(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                                             const VsplatGendenOptions& options, bool recompute) const;
  Trained fine_in_training(Context& ctx, VsplatModel::CoarseHalf half, const Tensor& images,
                           const std::vector<Camera>& cameras, const VsplatGendenOptions& options) const;
  Trained forward_in_training(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                              const VsplatGendenOptions& options, bool recompute) const;
  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const Tensor& drays = {}) const;

  // As VsplatModel::plan.
  MemoryPlan plan(const Context& ctx, long views, long selected) const;
  static MemoryPlan plan(const Context& ctx, const VsplatGendenConfig& config, const Weights& weights, long views,
                         long selected);

 private:
  Tensor score(Context& ctx, const DeviceGaussians& base, const Tensor& images, const std::vector<Camera>& cameras,
               const VsplatGendenOptions& options) const;
  DeviceGaussians densify(Context& ctx, const DeviceGaussians& base, const Tensor& refined, const Tensor& score,
                          const VsplatGendenOptions& options, Dense* keep) const;

  VsplatGendenConfig config_;
  VsplatModel backbone_;
  std::unique_ptr<Densifier> densifier_;
};

}  // namespace vsplat

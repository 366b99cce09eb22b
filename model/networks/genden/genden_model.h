// GenDen's network, whole: LaRa's with one Gaussian a voxel makes the candidates, and those at whose places the input
// views pull at most are replaced by finer ones.
#pragma once
#include <memory>
#include <vector>

#include "model/networks/genden/densifier.h"
#include "model/networks/lara/lara_model.h"
#include "model/networks/params/genden_config.h"

namespace vsplat {

struct GendenOptions {
  LaraOptions backbone;  // its tap and progress are those of everything
  CurveOrders orders;    // none: random_orders() of the seed
  std::uint64_t seed = 0;
  const Tensor* score = nullptr;  // [N], instead of what the views pull
};

struct GendenResult {
  DeviceGaussians coarse;  // of each voxel
  DeviceGaussians final;   // the new ones, then those that were not replaced
  std::vector<int> kept;   // of the coarse ones, ascending
};

class GendenModel {
 public:
  // Uploads and repacks the weights for the context's device and flavour.
  GendenModel(Context& ctx, const GendenConfig& config, const WeightSource& weights);

  const GendenConfig& config() const { return config_; }

  // As LaraModel::forward.
  GendenResult forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                       const GendenOptions& options) const;

  // A training's forward, in two halves or in one, and backward, as LaraModel has them. No gradient flows through the
  // scores.
  struct Trained {
    GendenResult result;
    LaraModel::Trained backbone;
    std::shared_ptr<Densifier::Saved> saved;
  };
  LaraModel::CoarseHalf coarse_in_training(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                                           const GendenOptions& options, bool recompute) const;
  Trained fine_in_training(Context& ctx, LaraModel::CoarseHalf half, const Tensor& images,
                           const std::vector<Camera>& cameras, const GendenOptions& options) const;
  Trained forward_in_training(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                              const GendenOptions& options, bool recompute) const;
  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                const GaussianGradients& dfinal) const;

  // As LaraModel::plan.
  MemoryPlan plan(const Context& ctx, long views, long kept) const;
  static MemoryPlan plan(const Context& ctx, const GendenConfig& config, const Weights& weights, long views, long kept);

 private:
  DeviceGaussians densify(Context& ctx, const LaraResult& base, const Tensor& score, const GendenOptions& options,
                          std::shared_ptr<Densifier::Saved>* saved) const;
  Tensor score(Context& ctx, const LaraResult& base, const Tensor& images, const std::vector<Camera>& cameras,
               const GendenOptions& options) const;

  GendenConfig config_;
  LaraModel backbone_;
  std::unique_ptr<Densifier> densifier_;
};

}  // namespace vsplat

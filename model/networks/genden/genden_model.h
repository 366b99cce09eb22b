// GenDen's whole network. LaRa's network with one Gaussian a voxel makes the candidates; those with the largest
// screen-space scores in the input views are replaced by finer ones.
#pragma once
#include <memory>
#include <vector>

#include "model/networks/genden/densifier.h"
#include "model/networks/lara/lara_model.h"
#include "model/networks/params/genden_config.h"

namespace vsplat {

struct GendenOptions {
  LaraOptions backbone;  // its tap and progress serve the whole network
  CurveOrders orders;    // empty: random_orders() of the seed
  std::uint64_t seed = 0;
  const Tensor* score = nullptr;  // [N], replaces the screen-space scores
};

struct GendenResult {
  DeviceGaussians coarse;  // one per voxel
  DeviceGaussians final;   // the new ones, then the coarse ones that were not replaced
  std::vector<int> kept;   // indices of the candidates among the coarse ones, ascending
};

class GendenModel {
 public:
  // Uploads and repacks the weights for the context's device and flavour.
  GendenModel(Context& ctx, const GendenConfig& config, const WeightSource& weights);

  const GendenConfig& config() const { return config_; }

  // As LaraModel::forward.
  GendenResult forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                       const GendenOptions& options) const;

  // A training's forward, in two halves or in one, and its backward, as in LaraModel. The scores are constants for the
  // gradient.
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

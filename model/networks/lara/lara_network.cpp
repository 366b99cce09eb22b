#include <utility>

#include "model/networks/lara/lara_options.h"
#include "model/networks/network.h"

namespace vsplat {
namespace {

class LaraNetwork : public NetworkWith<LaraModel, LaraConfig> {
 public:
  using NetworkWith::NetworkWith;

  Result forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                 const ForwardOptions& options) const override {
    const LaraResult made = model_.forward(ctx, images, cameras, lara_options(options));
    return {made.coarse, made.final, voxels_of(made.kept, model_.config()), model_.config().grid(), {}};
  }

  Half begin(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const ForwardOptions& options,
             bool recompute) const override {
    LaraModel::CoarseHalf half = model_.coarse_in_training(ctx, images, cameras, lara_options(options), recompute);
    const long kept = half.kept;
    return {kept, std::make_shared<StateOf<LaraModel::CoarseHalf>>(std::move(half))};
  }

  Trained finish(Context& ctx, Half half, const ForwardOptions& options) const override {
    LaraModel::Trained trained =
        model_.fine_in_training(ctx, std::move(value_in<LaraModel::CoarseHalf>(half.state)), lara_options(options));
    Trained out{trained.result.coarse, trained.result.final, half.selected, {}, {}};
    out.state = std::make_shared<StateOf<LaraModel::Trained>>(std::move(trained));
    return out;
  }

  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const Tensor&) const override {
    model_.backward(ctx, value_in<LaraModel::Trained>(trained.state), dcoarse, dfinal);
  }
};

}  // namespace

std::unique_ptr<Network> network_of(Context& ctx, const LaraConfig& config, const WeightSource& weights) {
  return std::make_unique<LaraNetwork>(ctx, config, weights);
}

}  // namespace vsplat

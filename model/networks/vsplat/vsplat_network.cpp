#include <utility>

#include "model/networks/network.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "model/networks/vsplat/vsplat_options.h"

namespace vsplat {
namespace {

class VsplatNetwork : public NetworkWith<VsplatModel, Config> {
 public:
  using NetworkWith::NetworkWith;

  Result forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                 const ForwardOptions& options) const override {
    ForwardResult made = model_.forward(ctx, images, upload_cameras(ctx, cameras), options);
    return {made.coarse, made.final, std::move(made.selected), model_.config().volume, made.rays};
  }

  Half begin(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const ForwardOptions& options,
             bool recompute) const override {
    VsplatModel::CoarseHalf half =
        model_.coarse_in_training(ctx, images, upload_cameras(ctx, cameras), options, recompute);
    const long selected = half.selected;
    return {selected, std::make_shared<StateOf<VsplatModel::CoarseHalf>>(std::move(half))};
  }

  Trained finish(Context& ctx, Half half, const ForwardOptions& options) const override {
    VsplatModel::Trained trained =
        model_.fine_in_training(ctx, std::move(value_in<VsplatModel::CoarseHalf>(half.state)), options);
    Trained out{trained.coarse, trained.final, trained.selected ? trained.selected.dim(0) : 0, trained.rays, {}};
    if (!config_.has_fine()) out.final = {};  // there is only the coarse level
    out.state = std::make_shared<StateOf<VsplatModel::Trained>>(std::move(trained));
    return out;
  }

  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const Tensor& drays) const override {
    model_.backward(ctx, value_in<VsplatModel::Trained>(trained.state), dcoarse, dfinal, {}, drays);
  }
};

}  // namespace

std::unique_ptr<Network> network_of(Context& ctx, const Config& config, const WeightSource& weights) {
  return std::make_unique<VsplatNetwork>(ctx, config, weights);
}

}  // namespace vsplat

#include <utility>

#include "model/networks/genden/vsplat_genden_model.h"
#include "model/networks/network.h"
#include "model/networks/vsplat/vsplat_options.h"

namespace vsplat {
namespace {

VsplatGendenOptions dense_options(const ForwardOptions& options) {
  VsplatGendenOptions out;
  out.backbone = options;
  return out;
}

class VsplatGendenNetwork : public Network {
 public:
  VsplatGendenNetwork(Context& ctx, const VsplatGendenConfig& config, const WeightSource& weights)
      : config_(config), model_(ctx, config, weights) {}

  const AnyConfig& config() const override { return config_; }
  RenderOptions drawing() const override { return drawing_of(model_.config()); }

  Result forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                 const ForwardOptions& options) const override {
    VsplatGendenResult made = model_.forward(ctx, images, cameras, dense_options(options));
    return {made.coarse, made.final, std::move(made.selected), model_.config().volume, made.rays};
  }

  MemoryPlan plan(const Context& ctx, long views, long selected) const override {
    return model_.plan(ctx, views, selected);
  }

  Half begin(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const ForwardOptions& options,
             bool recompute) const override {
    auto half = std::make_shared<Begun>();
    half->coarse = model_.coarse_in_training(ctx, images, cameras, dense_options(options), recompute);
    half->images = images;
    half->cameras = cameras;
    const long selected = half->coarse.selected;
    return {selected, std::move(half)};
  }

  Trained finish(Context& ctx, Half half, const ForwardOptions& options) const override {
    Begun& begun = *std::static_pointer_cast<Begun>(half.state);
    auto trained = std::make_shared<VsplatGendenModel::Trained>(
        model_.fine_in_training(ctx, std::move(begun.coarse), begun.images, begun.cameras, dense_options(options)));
    Trained out{trained->backbone.coarse, trained->final, half.selected, trained->backbone.rays, {}};
    out.state = std::move(trained);
    return out;
  }

  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const Tensor& drays) const override {
    model_.backward(ctx, *std::static_pointer_cast<VsplatGendenModel::Trained>(trained.state), dcoarse, dfinal, drays);
  }

 private:
  struct Begun {
    VsplatModel::CoarseHalf coarse;
    Tensor images;
    std::vector<Camera> cameras;
  };

  AnyConfig config_;
  VsplatGendenModel model_;
};

}  // namespace

std::unique_ptr<Network> network_of(Context& ctx, const VsplatGendenConfig& config, const WeightSource& weights) {
  return std::make_unique<VsplatGendenNetwork>(ctx, config, weights);
}

}  // namespace vsplat

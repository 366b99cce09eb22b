#include <utility>

#include "model/networks/genden/genden_model.h"
#include "model/networks/lara/lara_options.h"
#include "model/networks/network.h"

namespace vsplat {
namespace {

GendenOptions genden_options(const ForwardOptions& options) {
  GendenOptions out;
  out.backbone = lara_options(options);
  out.seed = options.selection_seed.value_or(0);
  return out;
}

class GendenNetwork : public Network {
 public:
  GendenNetwork(Context& ctx, const GendenConfig& config, const WeightSource& weights)
      : config_(config), model_(ctx, config, weights) {}

  const AnyConfig& config() const override { return config_; }
  RenderOptions drawing() const override { return drawing_of(model_.config()); }

  Result forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                 const ForwardOptions& options) const override {
    const GendenResult made = model_.forward(ctx, images, cameras, genden_options(options));
    return {made.coarse, made.final, voxels_of(made.kept, model_.config()), model_.config().grid(), {}};
  }

  MemoryPlan plan(const Context& ctx, long views, long selected) const override {
    return model_.plan(ctx, views, selected);
  }

  Half begin(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const ForwardOptions& options,
             bool recompute) const override {
    auto half = std::make_shared<Begun>();
    half->coarse = model_.coarse_in_training(ctx, images, cameras, genden_options(options), recompute);
    half->images = images;
    half->cameras = cameras;
    const long kept = half->coarse.kept;
    return {kept, std::move(half)};
  }

  Trained finish(Context& ctx, Half half, const ForwardOptions& options) const override {
    Begun& begun = *std::static_pointer_cast<Begun>(half.state);
    auto trained = std::make_shared<GendenModel::Trained>(
        model_.fine_in_training(ctx, std::move(begun.coarse), begun.images, begun.cameras, genden_options(options)));
    Trained out{trained->result.coarse, trained->result.final, half.selected, {}, {}};
    out.state = std::move(trained);
    return out;
  }

  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const Tensor&) const override {
    model_.backward(ctx, *std::static_pointer_cast<GendenModel::Trained>(trained.state), dcoarse, dfinal);
  }

 private:
  struct Begun {
    LaraModel::CoarseHalf coarse;
    Tensor images;
    std::vector<Camera> cameras;
  };

  AnyConfig config_;
  GendenModel model_;
};

}  // namespace

std::unique_ptr<Network> network_of(Context& ctx, const GendenConfig& config, const WeightSource& weights) {
  return std::make_unique<GendenNetwork>(ctx, config, weights);
}

}  // namespace vsplat

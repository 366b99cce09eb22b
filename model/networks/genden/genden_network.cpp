// Generative Densification on a backbone: one class for LaRa's and VS-Splat's network, with a traits struct for each.
#include <utility>

#include "model/networks/genden/genden_model.h"
#include "model/networks/genden/vsplat_genden_model.h"
#include "model/networks/lara/lara_options.h"
#include "model/networks/network.h"
#include "model/networks/vsplat/vsplat_options.h"

namespace vsplat {
namespace {

struct OnLara {
  using Config = GendenConfig;
  using Model = GendenModel;
  using CoarseHalf = LaraModel::CoarseHalf;

  static GendenOptions options(const ForwardOptions& options) {
    GendenOptions out;
    out.backbone = lara_options(options);
    out.seed = options.selection_seed.value_or(0);
    return out;
  }
  static Network::Result result(GendenResult made, const Model& model) {
    return {made.coarse, made.final, voxels_of(made.kept, model.config()), model.config().grid(), {}};
  }
  static long selected(const CoarseHalf& half) { return half.kept; }
  static Network::Trained result(const Model::Trained& made, long selected) {
    return {made.result.coarse, made.result.final, selected, {}, {}};
  }
  static void backward(Context& ctx, const Model& model, Model::Trained& made, const GaussianGradients& dcoarse,
                       const GaussianGradients& dfinal, const Tensor&) {
    model.backward(ctx, made, dcoarse, dfinal);
  }
};

struct OnVsplat {
  using Config = VsplatGendenConfig;
  using Model = VsplatGendenModel;
  using CoarseHalf = VsplatModel::CoarseHalf;

  static VsplatGendenOptions options(const ForwardOptions& options) {
    VsplatGendenOptions out;
    out.backbone = options;
    return out;
  }
  static Network::Result result(VsplatGendenResult made, const Model& model) {
    return {made.coarse, made.final, std::move(made.selected), model.config().volume, made.rays};
  }
  static long selected(const CoarseHalf& half) { return half.selected; }
  static Network::Trained result(const Model::Trained& made, long selected) {
    return {made.backbone.coarse, made.final, selected, made.backbone.rays, {}};
  }
  static void backward(Context& ctx, const Model& model, Model::Trained& made, const GaussianGradients& dcoarse,
                       const GaussianGradients& dfinal, const Tensor& drays) {
    model.backward(ctx, made, dcoarse, dfinal, drays);
  }
};

template <typename Backbone>
class GendenNetwork : public NetworkWith<typename Backbone::Model, typename Backbone::Config> {
  using Base = NetworkWith<typename Backbone::Model, typename Backbone::Config>;
  using Base::model_;

 public:
  using Base::Base;
  using typename Base::Half, typename Base::Result, typename Base::Trained;

  Result forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                 const ForwardOptions& options) const override {
    return Backbone::result(model_.forward(ctx, images, cameras, Backbone::options(options)), model_);
  }

  Half begin(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras, const ForwardOptions& options,
             bool recompute) const override {
    Begun begun{model_.coarse_in_training(ctx, images, cameras, Backbone::options(options), recompute), images,
                cameras};
    const long selected = Backbone::selected(begun.coarse);
    return {selected, std::make_shared<Network::StateOf<Begun>>(std::move(begun))};
  }

  Trained finish(Context& ctx, Half half, const ForwardOptions& options) const override {
    auto& begun = Network::value_in<Begun>(half.state);
    typename Model::Trained made =
        model_.fine_in_training(ctx, std::move(begun.coarse), begun.images, begun.cameras, Backbone::options(options));
    Trained out = Backbone::result(made, half.selected);
    out.state = std::make_shared<Network::StateOf<typename Model::Trained>>(std::move(made));
    return out;
  }

  void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse, const GaussianGradients& dfinal,
                const Tensor& drays) const override {
    Backbone::backward(ctx, model_, Network::value_in<typename Model::Trained>(trained.state), dcoarse, dfinal, drays);
  }

 private:
  using Model = typename Backbone::Model;
  struct Begun {
    typename Backbone::CoarseHalf coarse;
    Tensor images;
    std::vector<Camera> cameras;
  };
};

}  // namespace

std::unique_ptr<Network> network_of(Context& ctx, const GendenConfig& config, const WeightSource& weights) {
  return std::make_unique<GendenNetwork<OnLara>>(ctx, config, weights);
}

std::unique_ptr<Network> network_of(Context& ctx, const VsplatGendenConfig& config, const WeightSource& weights) {
  return std::make_unique<GendenNetwork<OnVsplat>>(ctx, config, weights);
}

}  // namespace vsplat

#include "model/networks/params/params.h"

#include "model/networks/params/densify_layers.h"
#include "model/networks/params/lara_layers.h"
#include "model/networks/params/network_layers.h"

namespace vsplat {
namespace {

// Turns a declaration into a list: a layer is just its parameters.
class Lister {
 public:
  struct Listed {};
  using Fixed = Listed;
  using Learnt = Listed;
  using Positions = Listed;
  using Linear = Listed;
  using ScaledLinear = Listed;
  using SplitLinear = Listed;
  using Conv = Listed;
  using ConvUp = Listed;
  using LayerNorm = Listed;
  using GroupNorm = Listed;
  struct Mlp3 {
    Listed first, second, third;
  };

  explicit Lister(std::vector<Parameter>& out) : out_(&out) {}

  Listed fixed(const Parameter& p) const { return add({p}); }
  Listed learnt(const Parameter& p) const { return add({p}); }
  Listed positions(const Parameter& class_token, const Parameter& stored, int, int) const {
    return add({class_token, stored});
  }
  Listed linear(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed scaled_linear(const LayerParameters& p, const Listed*) const { return add({p.weight, p.bias}); }
  Listed split_linear(const LayerParameters& p, long) const { return add({p.weight, p.bias}); }
  Listed conv3d(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed conv3d_down(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed conv3d_up(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed submanifold(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed layer_norm(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed group_norm(const LayerParameters& p, int) const { return add({p.weight, p.bias}); }

 private:
  Listed add(std::initializer_list<Parameter> some) const {
    for (const Parameter& p : some)
      if (!p.name.empty()) out_->push_back(p);
    return {};
  }

  std::vector<Parameter>* out_;
};

}  // namespace

// NOLINTBEGIN(bugprone-unused-raii): a layer lists its parameters when it is made
std::vector<Parameter> parameters(const Config& config) {
  std::vector<Parameter> out;
  const LayerBuilder<Lister> build{Lister(out)};
  FinePlaceLayers<Lister>(build, config);
  EncoderLayers<Lister>(build.in("encoder"), config.encoder_sizes());
  ModulationLayers<Lister>(build, config);
  LiftingLayers<Lister>(build, config);
  VolumeLayers<Lister>(build, config);
  RefinementLayers<Lister>(build, config);
  CoarseHeadLayers<Lister>(build, config);
  FineHeadLayers<Lister>(build, config);
  RayPredictorLayers<Lister>(build, config);
  return out;
}

std::vector<Parameter> parameters(const LaraConfig& config) {
  std::vector<Parameter> out;
  const LayerBuilder<Lister> build{Lister(out)};
  LaraViewLayers<Lister>(build, config);
  EncoderLayers<Lister>(build.in("img_encoder"), config.encoder_sizes());
  LaraModulationLayers<Lister>(build, config);
  LaraVolumeLayers<Lister>(build, config);
  LaraCoarseLayers<Lister>(build, config);
  LaraFineLayers<Lister>(build, config);
  return out;
}

std::vector<Parameter> parameters(const GendenConfig& config) {
  std::vector<Parameter> out = parameters(static_cast<const LaraConfig&>(config));
  DensifyLayers<Lister>(LayerBuilder<Lister>{Lister(out)}, config.densify, config.sh_count());
  return out;
}

std::vector<Parameter> parameters(const VsplatGendenConfig& config) {
  std::vector<Parameter> out = parameters(static_cast<const Config&>(config));
  DensifyLayers<Lister>(LayerBuilder<Lister>{Lister(out)}, config.densify, config.sh_count());
  return out;
}
// NOLINTEND(bugprone-unused-raii)

}  // namespace vsplat

#include "model/params/params.h"

#include "model/params/network_layers.h"

namespace vsplat {
namespace {

// What makes a list of a declaration: a layer is nothing but its parameters.
class Lister {
 public:
  struct Listed {};
  using Fixed = Listed;
  using Positions = Listed;
  using Linear = Listed;
  using SplitLinear = Listed;
  using Conv = Listed;
  using LayerNorm = Listed;
  using GroupNorm = Listed;
  struct Mlp3 {
    Listed first, second, third;
  };

  explicit Lister(std::vector<Parameter>& out) : out_(&out) {}

  Listed fixed(const Parameter& p) const { return add({p}); }
  Listed positions(const Parameter& class_token, const Parameter& stored, int, int) const {
    return add({class_token, stored});
  }
  Listed linear(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed split_linear(const LayerParameters& p, long) const { return add({p.weight, p.bias}); }
  Listed conv3d(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed conv3d_down(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed submanifold(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed layer_norm(const LayerParameters& p) const { return add({p.weight, p.bias}); }
  Listed group_norm(const LayerParameters& p, int) const { return add({p.weight, p.bias}); }

 private:
  Listed add(std::initializer_list<Parameter> some) const {
    out_->insert(out_->end(), some);
    return {};
  }

  std::vector<Parameter>* out_;
};

}  // namespace

std::vector<Parameter> parameters(const Config& config) {
  std::vector<Parameter> out;
  const LayerBuilder<Lister> build{Lister(out)};
  FinePlaceLayers<Lister>(build, config);
  EncoderLayers<Lister>(build, config);
  ModulationLayers<Lister>(build, config);
  LiftingLayers<Lister>(build, config);
  VolumeLayers<Lister>(build, config);
  RefinementLayers<Lister>(build, config);
  CoarseHeadLayers<Lister>(build, config);
  FineHeadLayers<Lister>(build, config);
  return out;
}

long parameter_count(const Config& config) {
  long n = 0;
  for (const Parameter& parameter : parameters(config))
    if (parameter.trained) n += parameter.count();
  return n;
}

}  // namespace vsplat

#include "model/layers.h"

#include "model/ops/groupnorm.h"

namespace vsplat {
namespace {

long rows_of(const RowSource& a) { return a.map ? a.map.dim(0) : a.x0.dim(0); }

}  // namespace

Linear load_linear(const WeightLoader& weights, const std::string& name, long in, long out) {
  return {weights.linear(name + ".weight", {out, in}), weights.tensor(name + ".bias", {out})};
}

Linear load_pointwise(const WeightLoader& weights, const std::string& name, long in, long out) {
  return {weights.linear(name + ".weight", {out, in, 1, 1, 1}), weights.tensor(name + ".bias", {out})};
}

Tensor linear(Context& ctx, const Linear& layer, const RowSource& in, const char* name, Activation activation) {
  Gemm g;
  g.a = in;
  g.b = &layer.w;
  g.bias = layer.bias;
  g.activation = activation;
  g.out = ctx.tensor({rows_of(in), layer.w.n}, Type::f32, name);
  g.name = name;
  gemm(ctx, g);
  return g.out;
}

GroupNorm load_group_norm(const WeightLoader& weights, const std::string& name, long channels, int groups) {
  return {weights.tensor(name + ".weight", {channels}), weights.tensor(name + ".bias", {channels}), groups};
}

RowSource norm_silu(Context& ctx, const GroupNorm& norm, const Tensor& x0, const Tensor& x1) {
  GroupNormForward f;
  f.x0 = x0;
  f.x1 = x1;
  f.gamma = norm.gamma;
  f.beta = norm.beta;
  f.groups = norm.groups;
  f.scale = ctx.tensor({norm.gamma.dim(0)}, Type::f32, "groupnorm.scale");
  f.shift = ctx.tensor({norm.gamma.dim(0)}, Type::f32, "groupnorm.shift");
  groupnorm_forward(ctx, f);
  RowSource out;
  out.x0 = x0;
  out.x1 = x1;
  out.scale = f.scale;
  out.shift = f.shift;
  out.silu = true;
  return out;
}

Mlp3 load_mlp3(const WeightLoader& weights, const std::string& name, long in, long out) {
  return {load_linear(weights, name + ".0", in, in), load_linear(weights, name + ".2", in, in),
          load_linear(weights, name + ".4", in, out)};
}

Tensor mlp3(Context& ctx, const Mlp3& mlp, const Tensor& x, const char* name) {
  RowSource in;
  in.x0 = x;
  in.x0 = linear(ctx, mlp.first, in, name, Activation::silu);
  in.x0 = linear(ctx, mlp.second, in, name, Activation::silu);
  return linear(ctx, mlp.third, in, name);
}

}  // namespace vsplat

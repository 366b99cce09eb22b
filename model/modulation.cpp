#include "model/modulation.h"

#include "model/ops/layernorm.h"
#include "model/ops/plucker.h"

namespace vsplat {

PoseModulation::PoseModulation(Context& ctx, const Config& config, const WeightSource& weights) : config_(config) {
  const WeightLoader load(ctx, weights, "dir_norm.");
  const long c = config.vit_dim;
  gamma_ = load.tensor("norm.weight", {c});
  beta_ = load.tensor("norm.bias", {c});
  weight0_ = load.linear("mlp.0.weight", {c, 32});
  bias0_ = load.tensor("mlp.0.bias", {c});
  weight1_ = load.linear("mlp.2.weight", {2 * c, c});
  bias1_ = load.tensor("mlp.2.bias", {2 * c});
}

Tensor PoseModulation::forward(Context& ctx, const Tensor& tokens, const DeviceCameras& cameras) const {
  const Stage stage(ctx, "modulation");
  const long v = tokens.dim(0), t = config_.tokens(), c = config_.vit_dim, rows = v * t * t;
  const Tensor film = ctx.tensor({v, t * t, 2 * c}, Type::f32, "modulation.film");
  {
    const Tensor rays = ctx.tensor({v, t, t, 32}, Type::f32, "modulation.rays");
    plucker_forward(ctx, {cameras, config_.patch, rays});
    const Tensor hidden = ctx.tensor({rows, c}, Type::f32, "modulation.hidden");
    Gemm first;
    first.a.x0 = rays.reshaped({rows, 32});
    first.b = &weight0_;
    first.bias = bias0_;
    first.activation = Activation::silu;
    first.out = hidden;
    first.name = "dir_norm.mlp.0";
    gemm(ctx, first);
    Gemm second;
    second.a.x0 = hidden;
    second.b = &weight1_;
    second.bias = bias1_;
    second.out = film.reshaped({rows, 2 * c});
    second.name = "dir_norm.mlp.2";
    gemm(ctx, second);
  }
  const Tensor features = ctx.tensor({v, t, t, c}, Type::f32, "features");
  modulate_forward(ctx, {tokens, gamma_, beta_, film, 1e-6f, features.reshaped({v, t * t, c})});
  return features;
}

}  // namespace vsplat

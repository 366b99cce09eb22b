#include "model/networks/lara/ray_modulation.h"

#include "model/ops/dense/layernorm.h"
#include "model/ops/networks/plucker.h"

namespace vsplat {
namespace {

constexpr float kEps = 1e-6f;

}  // namespace

LaraModulation::LaraModulation(Context& ctx, const LaraConfig& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

Tensor LaraModulation::forward(Context& ctx, const Tensor& tokens, const DeviceCameras& cameras, Saved* saved) const {
  const Stage stage(ctx, "modulation");
  const long v = tokens.dim(0), t = config_.tokens(), c = config_.vit_dim;
  const Tensor rays = ctx.tensor({v, t, t, kRayValues}, Type::f32, "modulation.rays");
  plucker_forward(ctx, {cameras, config_.patch, rays});
  const Tensor rows = rays.reshaped({v * t * t, kRayValues});
  const Tensor film =
      linear_forward(ctx, layers_.film, rows_of(rows, true), "dir_norm.mlp.1").reshaped({v, t * t, 2 * c});
  if (saved) *saved = {tokens, rows, film};
  const Tensor features = ctx.tensor({v, t, t, c}, Type::f32, "features");
  modulate_forward(ctx, {tokens, layers_.norm.gamma, layers_.norm.beta, film, kEps, features.reshaped({v, t * t, c})});
  return features;
}

Tensor LaraModulation::backward(Context& ctx, const Saved& s, const Tensor& dfeatures) const {
  const Stage stage(ctx, "modulation");
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "modulation.gradient"); };
  const Tensor dtokens = like(s.tokens), dfilm = like(s.film);
  const long v = s.film.dim(0), texels = s.film.dim(1), c = config_.vit_dim;
  modulate_backward(
      ctx, {s.tokens, layers_.norm.gamma, layers_.norm.beta, s.film, kEps, dfeatures.reshaped({v, texels, c}), dtokens,
            dfilm, layers_.norm.dgamma, layers_.norm.dbeta, false});
  const Tensor by_row = dfilm.reshaped({v * texels, 2 * c});
  linear_backward(ctx, layers_.film, {rows_of(s.rays, true), by_row, {}, {}, false, "dir_norm.mlp.1"});
  return dtokens;
}

}  // namespace vsplat

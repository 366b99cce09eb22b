#include "model/networks/vsplat/pose_modulation.h"

#include "model/ops/dense/activation.h"
#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/layernorm.h"
#include "model/ops/networks/plucker.h"
#include "model/ops/networks/ray_harmonics.h"
#include "runtime/fail.h"

namespace vsplat {

PoseModulation::PoseModulation(Context& ctx, const Config& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

Tensor PoseModulation::forward(Context& ctx, const Tensor& tokens, const DeviceCameras& cameras, Saved* saved,
                               const Tensor& predicted) const {
  const Stage stage(ctx, "modulation");
  const long v = tokens.dim(0), t = config_.tokens(), c = config_.vit_dim;
  Tensor film;
  {
    const Tensor rays = ctx.tensor({v, t, t, kRayValues}, Type::f32, "modulation.rays");
    const Tensor rows = rays.reshaped({v * t * t, kRayValues});
    if (predicted)
      ray_harmonics_forward(ctx, {predicted.reshaped({v * t * t, 6}), rows});
    else
      plucker_forward(ctx, {cameras, config_.patch, rays});
    const Tensor hidden = linear_forward(ctx, layers_.first, rows_of(rows), "dir_norm.mlp.0",
                                         saved ? Activation::none : Activation::silu);
    film = linear_forward(ctx, layers_.second, rows_of(hidden, saved != nullptr), "dir_norm.mlp.2")
               .reshaped({v, t * t, 2 * c});
    if (saved) *saved = {tokens, predicted, rows, hidden, film};
  }
  const Tensor features = ctx.tensor({v, t, t, c}, Type::f32, "features");
  modulate_forward(ctx, {tokens, layers_.norm.gamma, layers_.norm.beta, film, 1e-6f, features.reshaped({v, t * t, c})});
  return features;
}

Tensor PoseModulation::backward(Context& ctx, const Saved& s, const Tensor& dfeatures, const Tensor& drays) const {
  const Stage stage(ctx, "modulation");
  if (!layers_.norm.dgamma)
    fail(Status::internal, "the modulation's weights have no gradients: it was made for inference");
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "modulation.gradient"); };
  const Tensor dtokens = like(s.tokens), dfilm = like(s.film), dhidden = like(s.hidden);
  const Tensor dy = dfeatures.reshaped({s.film.dim(0), s.film.dim(1), layers_.norm.gamma.dim(0)});
  modulate_backward(ctx, {s.tokens, layers_.norm.gamma, layers_.norm.beta, s.film, 1e-6f, dy, dtokens, dfilm,
                          layers_.norm.dgamma, layers_.norm.dbeta, false});
  const Tensor by_row = dfilm.reshaped({s.hidden.dim(0), dfilm.shape().back()});
  linear_backward(ctx, layers_.second, {rows_of(s.hidden, true), by_row, dhidden, {}, false, "dir_norm.mlp.2"});
  activation_backward(ctx, {s.hidden, Activation::silu, dhidden, dhidden});
  const Tensor dharmonics = drays ? like(s.rays) : Tensor();
  linear_backward(ctx, layers_.first, {rows_of(s.rays), dhidden, dharmonics, {}, false, "dir_norm.mlp.0"});
  if (drays) {
    const Tensor by_ray = ctx.tensor({s.rays.dim(0), 6}, Type::f32, "modulation.gradient");
    ray_harmonics_backward(ctx, {s.predicted.reshaped({s.rays.dim(0), 6}), dharmonics, by_ray});
    add_columns(ctx, {by_ray, drays.reshaped({s.rays.dim(0), 6})});
  }
  return dtokens;
}

}  // namespace vsplat

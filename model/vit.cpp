#include "model/vit.h"

#include "model/ops/attention.h"
#include "model/ops/layernorm.h"
#include "model/ops/patch_embed.h"
#include "model/ops/position_resample.h"

namespace vsplat {

Vit::Vit(Context& ctx, const Config& config, const WeightSource& weights) : config_(config) {
  const WeightLoader load(ctx, weights, "encoder.model.");
  const long c = config.vit_dim, g = config.vit_pos_grid, t = config.tokens(), p = config.patch;
  const auto norm = [&](const std::string& name) {
    return Norm{load.tensor(name + ".weight", {c}), load.tensor(name + ".bias", {c})};
  };
  const auto linear = [&](const std::string& name, long in, long out) {
    return Linear{load.linear(name + ".weight", {out, in}), load.tensor(name + ".bias", {out})};
  };
  patch_ = {load.linear("patch_embed.proj.weight", {c, 3, p, p}), load.tensor("patch_embed.proj.bias", {c})};
  position_ = ctx.tensor({1 + t * t, c}, Type::f32, "encoder.position");
  PositionResampleForward resample;
  resample.stored = load.tensor("pos_embed", {1, 1 + g * g, c}).reshaped({1 + g * g, c});
  resample.class_token = load.tensor("cls_token", {1, 1, c}).reshaped({c});
  resample.from = config.vit_pos_grid;
  resample.to = config.tokens();
  resample.out = position_;
  position_resample_forward(ctx, resample);
  for (int i = 0; i < config.vit_depth; ++i) {
    const std::string at = "blocks." + std::to_string(i) + ".";
    layers_.push_back({norm(at + "norm1"), norm(at + "norm2"), linear(at + "attn.qkv", c, 3 * c),
                       linear(at + "attn.proj", c, c), linear(at + "mlp.fc1", c, 4 * c),
                       linear(at + "mlp.fc2", 4 * c, c)});
  }
  norm_ = norm("norm");
}

// x [V, T, C] += attention(norm1(x)), then += mlp(norm2(x)).
void Vit::layer(Context& ctx, const Layer& l, const Tensor& x) const {
  const long v = x.dim(0), t = x.dim(1), c = x.dim(2), rows = v * t, h = config_.vit_heads;
  const Tensor flat = x.reshaped({rows, c});
  const auto normed = [&](const Norm& norm) {
    const Tensor out = ctx.tensor({rows, c}, Type::f32, "encoder.normed");
    layernorm_forward(ctx, {flat, norm.gamma, norm.beta, 1e-6f, out});
    return out;
  };
  const auto apply = [&](const Linear& linear, const Tensor& in, const Tensor& out, Activation act,
                         const Tensor& residual, const char* name) {
    Gemm g;
    g.a.x0 = in;
    g.b = &linear.weight;
    g.bias = linear.bias;
    g.activation = act;
    g.residual = residual;
    g.out = out;
    g.name = name;
    gemm(ctx, g);
  };
  {
    const Tensor qkv = ctx.tensor({v, t, 3, h, c / h}, Type::f32, "encoder.qkv");
    apply(l.qkv, normed(l.norm1), qkv.reshaped({rows, 3 * c}), Activation::none, {}, "attn.qkv");
    const Tensor attended = ctx.tensor({v, t, c}, Type::f32, "encoder.attended");
    attention_forward(ctx, {qkv, attended, {}});
    apply(l.proj, attended.reshaped({rows, c}), flat, Activation::none, flat, "attn.proj");
  }
  const Tensor hidden = ctx.tensor({rows, 4 * c}, Type::f32, "encoder.hidden");
  apply(l.fc1, normed(l.norm2), hidden, Activation::gelu, {}, "mlp.fc1");
  apply(l.fc2, hidden, flat, Activation::none, flat, "mlp.fc2");
}

Tensor Vit::forward(Context& ctx, const Tensor& images) const {
  const Stage stage(ctx, "encoder");
  const long v = images.dim(0), t = config_.tokens(), c = config_.vit_dim;
  const Tensor x = ctx.tensor({v, 1 + t * t, c}, Type::f32, "encoder.tokens");
  patch_embed_forward(ctx, {images, config_.patch, &patch_.weight, patch_.bias, position_, x});
  for (const Layer& l : layers_) layer(ctx, l, x);
  const Tensor flat = x.reshaped({v * (1 + t * t), c});
  layernorm_forward(ctx, {flat, norm_.gamma, norm_.beta, 1e-6f, flat});
  return x;
}

}  // namespace vsplat

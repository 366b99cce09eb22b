#include "model/network/vit.h"

#include "model/ops/attention.h"
#include "model/ops/layernorm.h"
#include "model/ops/patch_embed.h"
#include "model/ops/position_resample.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr float kEps = 1e-6f;

Tensor normed(Context& ctx, const LayerNorm& norm, const Tensor& x) {
  return normed_forward(ctx, norm, x, kEps, "encoder.normed");
}

}  // namespace

Vit::Vit(Context& ctx, const EncoderSizes& sizes, const WeightSource& weights, const std::string& module)
    : config_(sizes), layers_(layers_of(ctx, weights).in(module), sizes) {}

// y = x + attention(norm1(x)), then y + mlp(norm2(y)); in x's memory where nothing is saved.
Tensor Vit::forward(Context& ctx, const Block& l, const Tensor& x, BlockSaved* saved) const {
  const long v = x.dim(0), t = x.dim(1), c = x.dim(2), h = config_.vit_heads;
  const auto beside = [&](const char* what) { return saved ? ctx.tensor(x.shape(), Type::f32, what) : x; };
  const Tensor middle = beside("encoder.middle");
  {
    const Tensor qkv =
        linear_forward(ctx, l.qkv, rows_of(normed(ctx, l.norm1, x)), "attn.qkv").reshaped({v, t, 3, h, c / h});
    const Tensor attended = ctx.tensor({v, t, c}, Type::f32, "encoder.attended");
    const Tensor stats = saved ? ctx.tensor({v, h, t, 2}, Type::f32, "encoder.stats") : Tensor();
    attention_forward(ctx, {qkv, attended, stats});
    add_linear(ctx, l.proj, attended, x, middle, "attn.proj");
    if (saved) *saved = {x, qkv, attended, stats, middle, {}};
  }
  const Tensor out = beside("encoder.tokens");
  gelu_mlp_forward(ctx, {l.norm2, l.fc1, l.fc2, kEps}, middle, out, saved ? &saved->hidden : nullptr);
  return out;
}

Tensor Vit::forward(Context& ctx, const Tensor& images, Saved* saved) const {
  const Stage stage(ctx, "encoder");
  const long v = images.dim(0), t = config_.tokens(), c = config_.vit_dim;
  Tensor x = ctx.tensor({v, 1 + t * t, c}, Type::f32, "encoder.tokens");
  patch_embed_forward(
      ctx, {images, config_.patch, &layers_.patches.w, layers_.patches.bias, layers_.positions.resampled, x});
  if (saved) *saved = {images, std::vector<BlockSaved>(layers_.blocks.size()), {}};
  for (std::size_t i = 0; i < layers_.blocks.size(); ++i)
    x = forward(ctx, layers_.blocks[i], x, saved ? &saved->blocks[i] : nullptr);
  if (!saved) {
    layernorm_forward(ctx, {flat(x), layers_.norm.gamma, layers_.norm.beta, kEps, flat(x)});
    return x;
  }
  saved->last = x;
  return normed(ctx, layers_.norm, x).reshaped(x.shape());
}

// dx [V T, C]: by the block's result before, by its input after.
void Vit::backward(Context& ctx, const Block& l, const BlockSaved& s, const Tensor& dx) const {
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "encoder.gradient"); };
  gelu_mlp_backward(ctx, {l.norm2, l.fc1, l.fc2, kEps}, s.middle, s.hidden, dx);
  const Tensor dnormed = like(dx);
  const Tensor dqkv = like(s.qkv);
  {
    const Tensor dattended = like(s.attended);
    linear_backward(ctx, l.proj, {rows_of(s.attended), dx, dattended, {}, false, "attn.proj"});
    attention_backward(ctx, {s.qkv, s.attended, s.stats, dattended, dqkv});
  }
  const Tensor by_row = dqkv.reshaped({dx.dim(0), l.qkv.w.n});
  linear_backward(ctx, l.qkv, {rows_of(normed(ctx, l.norm1, s.x)), by_row, dnormed, {}, false, "attn.qkv"});
  normed_backward(ctx, l.norm1, s.x, kEps, dnormed, dx);
}

void Vit::backward(Context& ctx, const Saved& saved, const Tensor& dtokens) const {
  const Stage stage(ctx, "encoder");
  const LayerNorm& norm = layers_.norm;
  const Positions& positions = layers_.positions;
  if (!norm.dgamma) fail(Status::internal, "the encoder's weights have no gradients: it was made for inference");
  const Tensor dx = ctx.tensor(flat(saved.last).shape(), Type::f32, "encoder.gradient");
  layernorm_backward(ctx, {flat(saved.last), norm.gamma, kEps, flat(dtokens), dx, norm.dgamma, norm.dbeta, false});
  for (std::size_t i = layers_.blocks.size(); i-- > 0;) backward(ctx, layers_.blocks[i], saved.blocks[i], dx);
  const Tensor dposition = ctx.tensor(positions.resampled.shape(), Type::f32, "encoder.gradient");
  const long p = config_.patch;
  patch_embed_backward(
      ctx, {saved.images, config_.patch, dx.reshaped(saved.last.shape()),
            layers_.patches.dweight.reshaped({config_.vit_dim, 3, p, p}), layers_.patches.dbias, dposition});
  position_resample_backward(ctx, {dposition, positions.from, positions.to, positions.dstored, positions.dclass_token});
}

}  // namespace vsplat

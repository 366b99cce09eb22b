#include "model/networks/layers/vit.h"

#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/layernorm.h"
#include "model/ops/dense/patch_embed.h"
#include "model/ops/dense/position_resample.h"
#include "model/ops/dense/rope.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

// A tensor's values as one row.
Tensor row_of(const Tensor& x) { return x.reshaped({1, x.count()}); }

// Concatenates tensors.
Tensor side_by_side_of(Context& ctx, const std::vector<Tensor>& parts, const Shape& shape, const char* what) {
  const Tensor out = ctx.tensor(shape, Type::f32, what);
  ctx.fill_zero(out);
  long at = 0;
  for (const Tensor& part : parts) {
    if (part) add_columns(ctx, {row_of(part), row_of(out), at});
    if (part) at += part.count();
  }
  return out;
}

}  // namespace

Vit::Vit(Context& ctx, const EncoderSizes& sizes, const WeightSource& weights, const std::string& module)
    : config_(sizes), layers_(layers_of(ctx, weights).in(module), sizes), position_(layers_.positions.resampled) {
  if (!sizes.dinov3) return;
  const long c = sizes.vit_dim;
  position_ = side_by_side_of(ctx, {layers_.class_token.value, layers_.registers.value}, {sizes.prefix(), c},
                              "encoder.position");
  turns_ = make_turns(ctx, sizes.tokens(), sizes.tokens());
  if (!sizes.qkv_bias) return;
  for (TransformerBlock<WeightLoader>& block : layers_.blocks) {  // the keys' third is 0
    block.qkv.bias = ctx.tensor({3 * c}, Type::f32, "attn.qkv.bias");
    ctx.fill_zero(block.qkv.bias);
    add_columns(ctx, {row_of(block.q_bias.value), row_of(block.qkv.bias), 0});
    add_columns(ctx, {row_of(block.v_bias.value), row_of(block.qkv.bias), 2 * c});
  }
}

Tensor Vit::make_turns(Context& ctx, long h, long w) const {
  const long head = config_.vit_dim / config_.vit_heads;
  return ctx.upload({h * w, head / 2, 2}, rope_turns(h, w, head, config_.rope_base, config_.rope_bf16), Type::f32,
                    "encoder.turns");
}

BlockOptions Vit::options_for(Context& ctx, const Tensor& images) const {
  const long h = images.dim(1) / config_.patch, w = images.dim(2) / config_.patch, t = config_.tokens();
  return {config_.vit_heads, eps(), Activation::gelu,
          !config_.dinov3 || (h == t && w == t) ? turns_ : make_turns(ctx, h, w)};
}

Tensor Vit::forward(Context& ctx, const Tensor& images, Saved* saved) const {
  const Stage stage(ctx, "encoder");
  const long v = images.dim(0), p = config_.patch, c = config_.vit_dim;
  const long patches = (images.dim(1) / p) * (images.dim(2) / p);
  Tensor x = ctx.tensor({v, config_.prefix() + patches, c}, Type::f32, "encoder.tokens");
  patch_embed_forward(ctx, {images, config_.patch, &layers_.patches.w, layers_.patches.bias, position_, x});
  const BlockOptions options = options_for(ctx, images);
  if (saved) *saved = {images, std::vector<BlockSaved>(layers_.blocks.size()), {}};
  for (std::size_t i = 0; i < layers_.blocks.size(); ++i)
    x = block_forward(ctx, layers_.blocks[i], options, x, saved ? &saved->blocks[i] : nullptr);
  if (!saved) {
    layernorm_forward(ctx, {flat(x), layers_.norm.gamma, layers_.norm.beta, eps(), flat(x)});
    return x;
  }
  saved->last = x;
  return normed_forward(ctx, layers_.norm, x, eps(), "encoder.normed").reshaped(x.shape());
}

void Vit::backward_positions(Context& ctx, const Tensor& dposition) const {
  if (!config_.dinov3) {
    const Positions& positions = layers_.positions;
    position_resample_backward(ctx,
                               {dposition, positions.from, positions.to, positions.dstored, positions.dclass_token});
    return;
  }
  long from = 0;
  for (const Tensor& by : {layers_.class_token.gradient, layers_.registers.gradient}) {
    if (!by) continue;
    add_columns(ctx, {row_of(dposition), row_of(by), 0, from, by.count()});
    from += by.count();
  }
}

void Vit::backward(Context& ctx, const Saved& saved, const Tensor& dtokens) const {
  const Stage stage(ctx, "encoder");
  const LayerNorm& norm = layers_.norm;
  if (!norm.dgamma) fail(Status::internal, "the encoder's weights have no gradients: it was made for inference");
  const Tensor dx = ctx.tensor(flat(saved.last).shape(), Type::f32, "encoder.gradient");
  layernorm_backward(ctx, {flat(saved.last), norm.gamma, eps(), flat(dtokens), dx, norm.dgamma, norm.dbeta, false});
  const BlockOptions options = options_for(ctx, saved.images);
  for (std::size_t i = layers_.blocks.size(); i-- > 0;)
    block_backward(ctx, layers_.blocks[i], options, saved.blocks[i], dx);
  const Tensor dposition = ctx.tensor(position_.shape(), Type::f32, "encoder.gradient");
  const long p = config_.patch;
  patch_embed_backward(
      ctx, {saved.images, config_.patch, dx.reshaped(saved.last.shape()),
            layers_.patches.dweight.reshaped({config_.vit_dim, 3, p, p}), layers_.patches.dbias, dposition});
  backward_positions(ctx, dposition);
}

}  // namespace vsplat

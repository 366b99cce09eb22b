#include "model/networks/layers/transformer.h"

#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/attention.h"
#include "model/ops/dense/rope.h"

namespace vsplat {

Tensor block_forward(Context& ctx, const TransformerBlock<WeightLoader>& l, const BlockOptions& options,
                     const Tensor& x, BlockSaved* saved) {
  const long v = x.dim(0), t = x.dim(1), c = x.dim(2), h = options.heads;
  const auto beside = [&](const char* what) { return saved ? ctx.tensor(x.shape(), Type::f32, what) : x; };
  const Tensor middle = beside("block.middle");
  {
    const Tensor normed = normed_forward(ctx, l.norm1, x, options.eps, "block.normed");
    const Tensor qkv = linear_forward(ctx, l.qkv, rows_of(normed), "attn.qkv").reshaped({v, t, 3, h, c / h});
    if (options.turns) rope_forward(ctx, {qkv, options.turns});
    const Tensor attended = ctx.tensor({v, t, c}, Type::f32, "block.attended");
    const Tensor stats = saved ? ctx.tensor({v, h, t, 2}, Type::f32, "block.stats") : Tensor();
    attention_forward(ctx, {qkv, attended, stats});
    add_linear(ctx, l.proj.folded, attended, x, middle, "attn.proj");
    if (saved) *saved = {x, qkv, attended, stats, middle, {}};
  }
  const Tensor out = beside("block.tokens");
  gelu_mlp_forward(ctx, {l.norm2, l.fc1, l.fc2.folded, options.eps, options.activation}, middle, out,
                   saved ? &saved->hidden : nullptr);
  return out;
}

void block_backward(Context& ctx, const TransformerBlock<WeightLoader>& l, const BlockOptions& options,
                    const BlockSaved& s, const Tensor& dx) {
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "block.gradient"); };
  {
    const FoldedGradients fc2(ctx, l.fc2);
    gelu_mlp_backward(ctx, {l.norm2, l.fc1, fc2.linear(), options.eps, options.activation}, s.middle, s.hidden, dx);
    fc2.add(ctx);
  }
  const Tensor dnormed = like(dx);
  const Tensor dqkv = like(s.qkv);
  {
    const Tensor dattended = like(s.attended);
    const FoldedGradients proj(ctx, l.proj);
    linear_backward(ctx, proj.linear(), {rows_of(s.attended), dx, dattended, {}, false, "attn.proj"});
    proj.add(ctx);
    attention_backward(ctx, {s.qkv, s.attended, s.stats, dattended, dqkv});
    if (options.turns) rope_backward(ctx, {dqkv, options.turns});
  }
  const Tensor normed = normed_forward(ctx, l.norm1, s.x, options.eps, "block.normed");
  Linear qkv = l.qkv;
  if (l.q_bias.gradient) {
    qkv.dbias = ctx.tensor({l.qkv.w.n}, Type::f32, "block.gradient");
    ctx.fill_zero(qkv.dbias);
  }
  linear_backward(ctx, qkv, {rows_of(normed), dqkv.reshaped({dx.dim(0), l.qkv.w.n}), dnormed, {}, false, "attn.qkv"});
  if (l.q_bias.gradient) {
    const long c = l.q_bias.gradient.count();
    const Tensor dbias = qkv.dbias.reshaped({1, 3 * c});
    add_columns(ctx, {dbias, l.q_bias.gradient.reshaped({1, c}), 0, 0, c});
    add_columns(ctx, {dbias, l.v_bias.gradient.reshaped({1, c}), 0, 2 * c, c});
  }
  normed_backward(ctx, l.norm1, s.x, options.eps, dnormed, dx);
}

}  // namespace vsplat

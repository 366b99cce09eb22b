#include "model/ops/patch_embed.h"

#include "runtime/column_sum.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// The GEMM's rows, [V (1 + t t), 3 p p], of pictures [V, S, S, 3] with V > 0.
Tensor patch_rows(Context& ctx, const Tensor& images, int p, long tokens) {
  const long v = images.dim(0), s = images.dim(1);
  const Tensor rows = ctx.tensor({v * tokens, 3L * p * p}, Type::f32, "patch_embed.rows");
  ctx.launch({"patch_embed", "patch_embed_rows", ""}, groups((p + 15) / 16, 16, tokens, v),
             {2.0 * static_cast<double>(rows.count()), 2.0 * static_cast<double>(rows.bytes())}, images, written(rows),
             v, s, p);
  return rows;
}

// 1 + t t, and the letters V, S and T bound.
long bind_images(Dims& d, const Tensor& images, int p) {
  d.bind("images", images, {"V", "S", "S", "3"});
  const long s = d["S"];
  if (p < 1 || s % p != 0) fail(Status::internal, "patch_embed: pictures of {} pixels, patches of {}", s, p);
  const long tokens = 1 + (s / p) * (s / p);
  d.set("T", tokens);
  return tokens;
}

}  // namespace

void patch_embed_forward(Context& ctx, const PatchEmbedForward& a) {
  Dims d;
  const long tokens = bind_images(d, a.images, a.patch), k = 3L * a.patch * a.patch;
  d.bind("position", a.position, {"T", "C"}).bind("bias", a.bias, {"C"}).bind("out", a.out, {"V", "T", "C"});
  const long v = d["V"], c = d["C"];
  if (!a.weight || a.weight->k != k || a.weight->n != c)
    fail(Status::internal, "patch_embed: the weight is not [{}, {}]", k, c);
  if (v == 0) return;
  Gemm g;
  g.a.x0 = patch_rows(ctx, a.images, a.patch, tokens);
  g.b = a.weight;
  g.bias = a.bias;
  g.out = a.out.reshaped({v * tokens, c});
  g.name = "patch_embed";
  gemm(ctx, g);
  ctx.launch({"patch_embed", "patch_embed_forward_tokens", ""}, groups((c + 255) / 256, 64, tokens, v),
             {static_cast<double>(a.out.count()), 2.0 * static_cast<double>(a.out.bytes())}, a.position, written(a.out),
             v, tokens, c);
}

void patch_embed_backward(Context& ctx, const PatchEmbedBackward& a) {
  Dims d;
  const long tokens = bind_images(d, a.images, a.patch), p = a.patch, k = 3 * p * p;
  d.bind("dtokens", a.dtokens, {"V", "T", "C"}).bind("dposition", a.dposition, {"T", "C"});
  d.set("p", p).bind("dweight", a.dweight, {"C", "3", "p", "p"}).bind("dbias", a.dbias, {"C"});
  const long v = d["V"], c = d["C"];
  if (v == 0) return ctx.fill_zero(a.dposition);
  // The class tokens' rows are zero: what came back to them reaches no weight.
  TransposedGemm g;
  g.a = a.dtokens;
  g.b = patch_rows(ctx, a.images, a.patch, tokens);
  g.out = a.dweight.reshaped({c, k});
  g.add = true;
  g.name = "patch_embed.dweight";
  transposed_gemm(ctx, g);
  const Tensor dpatches = ctx.tensor({tokens - 1, c}, Type::f32, "patch_embed.dpatches");
  ctx.launch({"patch_embed", "patch_embed_backward_positions", ""}, groups((c + 63) / 64, 64, tokens),
             {static_cast<double>(a.dtokens.count()), static_cast<double>(a.dtokens.bytes() + 2 * a.dposition.bytes())},
             a.dtokens, written(a.dposition), written(dpatches), v, tokens, c);
  column_sum(ctx, {dpatches, a.dbias, true});
}

}  // namespace vsplat

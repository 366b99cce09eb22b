#include "model/ops/dense/patch_embed.h"

#include "runtime/column_sum.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Sizes of a call, for both directions.
struct PatchSizes {
  long v, h, w, t, c, n, prefix;  // V, H, W, T, C; rows of the position, and P

  PatchSizes(Dims& d, const Tensor& images, int p, const Tensor& tokens, const char* name, const Tensor& position,
             const char* position_name) {
    d.bind("images", images, {"V", "H", "W", "3"}).bind(name, tokens, {"V", "T", "C"});
    d.bind(position_name, position, {"N", "C"});
    v = d["V"], h = d["H"], w = d["W"], t = d["T"], c = d["C"], n = d["N"];
    if (p < 1 || h % p != 0 || w % p != 0)
      fail(Status::internal, "patch_embed: pictures of {} x {} pixels, patches of {}", w, h, p);
    prefix = t - (h / p) * (w / p);
    if (prefix < 0 || (n != t && n != prefix))
      fail(Status::internal, "patch_embed: {} tokens, {} positions of them, {} patches", t, n, t - prefix);
  }
};

// The GEMM's rows, [V T, 3 p p], of pictures with V > 0.
Tensor patch_rows(Context& ctx, const Tensor& images, int p, const PatchSizes& z) {
  const Tensor rows = ctx.tensor({z.v * z.t, 3L * p * p}, Type::f32, "patch_embed.rows");
  ctx.launch({"patch_embed", "patch_embed_rows", ""}, groups((p + 15) / 16, 16, z.t, z.v),
             {2.0 * static_cast<double>(rows.count()), 2.0 * static_cast<double>(rows.bytes())}, images, written(rows),
             z.v, z.h, z.w, p, z.prefix);
  return rows;
}

}  // namespace

void patch_embed_forward(Context& ctx, const PatchEmbedForward& a) {
  Dims d;
  const PatchSizes z(d, a.images, a.patch, a.out, "out", a.position, "position");
  const long k = 3L * a.patch * a.patch;
  d.bind("bias", a.bias, {"C"});
  if (!a.weight || a.weight->k != k || a.weight->n != z.c)
    fail(Status::internal, "patch_embed: the weight is not [{}, {}]", k, z.c);
  if (z.v == 0) return;
  Gemm g;
  g.a.x0 = patch_rows(ctx, a.images, a.patch, z);
  g.b = a.weight;
  g.bias = a.bias;
  g.out = a.out.reshaped({z.v * z.t, z.c});
  g.name = "patch_embed";
  gemm(ctx, g);
  if (z.n == 0) return;
  const auto values = static_cast<double>(z.v * z.n * z.c);
  ctx.launch({"patch_embed", "patch_embed_forward_tokens", ""}, groups((z.c + 255) / 256, 64, z.n, z.v),
             {values, 8 * values}, a.position, written(a.out), z.v, z.t, z.c, z.prefix, z.n);
}

void patch_embed_backward(Context& ctx, const PatchEmbedBackward& a) {
  Dims d;
  const PatchSizes z(d, a.images, a.patch, a.dtokens, "dtokens", a.dposition, "dposition");
  const long p = a.patch, k = 3 * p * p;
  d.set("p", p).bind("dweight", a.dweight, {"C", "3", "p", "p"}).bind("dbias", a.dbias, {"C"});
  if (z.v == 0) return ctx.fill_zero(a.dposition);
  // The rows of tokens that are no patches are zero: their gradients reach no weight.
  TransposedGemm g;
  g.a = a.dtokens;
  g.b = patch_rows(ctx, a.images, a.patch, z);
  g.out = a.dweight.reshaped({z.c, k});
  g.add = true;
  g.name = "patch_embed.dweight";
  transposed_gemm(ctx, g);
  const Tensor dpatches = ctx.tensor({z.t - z.prefix, z.c}, Type::f32, "patch_embed.dpatches");
  ctx.launch({"patch_embed", "patch_embed_backward_positions", ""}, groups((z.c + 63) / 64, 64, z.t),
             {static_cast<double>(a.dtokens.count()), static_cast<double>(a.dtokens.bytes() + 2 * dpatches.bytes())},
             a.dtokens, written(a.dposition), written(dpatches), z.v, z.t, z.c, z.prefix, z.n);
  column_sum(ctx, {dpatches, a.dbias, true});
}

}  // namespace vsplat

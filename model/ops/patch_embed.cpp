#include "model/ops/patch_embed.h"

#include "runtime/shape_check.h"

namespace vsplat {

void patch_embed_forward(Context& ctx, const PatchEmbedForward& a) {
  Dims d;
  d.bind("images", a.images, {"V", "S", "S", "3"});
  const long v = d["V"], s = d["S"], p = a.patch;
  if (p < 1 || s % p != 0) fail(Status::internal, "patch_embed: pictures of {} pixels, patches of {}", s, p);
  const long tokens = 1 + (s / p) * (s / p), k = 3 * p * p;
  d.set("T", tokens).bind("position", a.position, {"T", "C"}).bind("bias", a.bias, {"C"});
  d.bind("out", a.out, {"V", "T", "C"});
  const long c = d["C"];
  if (!a.weight || a.weight->k != k || a.weight->n != c)
    fail(Status::internal, "patch_embed: the weight is not [{}, {}]", k, c);
  if (v == 0) return;
  const int vi = static_cast<int>(v);
  const Tensor rows = ctx.tensor({v * tokens, k}, Type::f32, "patch_embed.rows");
  ctx.launch({"patch_embed", "patch_rows", ""}, groups((p + 15) / 16, 16, tokens, v),
             {2.0 * static_cast<double>(rows.count()), 2.0 * static_cast<double>(rows.bytes())}, a.images, rows, vi,
             static_cast<int>(s), a.patch);
  Gemm g;
  g.a.x0 = rows;
  g.b = a.weight;
  g.bias = a.bias;
  g.out = a.out.reshaped({v * tokens, c});
  g.name = "patch_embed";
  gemm(ctx, g);
  ctx.launch({"patch_embed", "patch_tokens", ""}, groups((c + 255) / 256, 64, tokens, v),
             {static_cast<double>(a.out.count()), 2.0 * static_cast<double>(a.out.bytes())}, a.position, a.out, vi,
             static_cast<int>(tokens), static_cast<int>(c));
}

}  // namespace vsplat

#include "model/ops/fit/splat_split.h"

#include <algorithm>

#include "model/ops/volume/compact.h"
#include "model/ops/volume/top_k.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// The Gaussians that are split, and the free places for their second halves.
struct Halves {
  Tensor sources, slots;
  long count = 0, free = 0, splits = 0;
};

void copy_rows(Context& ctx, const Halves& h, const Tensor& x, const Tensor& m, const Tensor& v) {
  const long width = m.count() / m.dim(0);
  ctx.launch({"splat_split", "splat_split_copy", ""}, groups((width + 15) / 16, 16, h.splits), {}, h.sources, h.slots,
             written_somewhere(x), written_somewhere(m), written_somewhere(v), h.count, h.free, width);
}

}  // namespace

void splat_error(Context& ctx, const Tensor& colour, const Tensor& target, const Tensor& error) {
  Dims d;
  d.bind("colour", colour, {"H", "W", "3"}).bind("target", target, {"H", "W", "3"}).bind("error", error, {"H", "W"});
  const auto pixels = static_cast<double>(error.count());
  ctx.launch({"splat_split", "splat_split_error", ""}, items(error.count()), {9 * pixels, 28 * pixels}, colour, target,
             written(error), error.count());
}

void splat_scores(Context& ctx, const SplatScores& a) {
  Dims d;
  d.bind("ids", a.visible.ids, {"N"}, Type::u32).bind("records", a.visible.records, {"N", "12"});
  d.bind("rows", a.intersections.rows, {"M", "10"});
  d.bind("touched", a.intersections.touched, {"M"}, Type::u8).bind("scores", a.scores, {"K"});
  const long n = d["N"];
  d.set("N + 1", n + 1).bind("offsets", a.offsets, {"N + 1"}, Type::u32);
  const auto rows = static_cast<double>(d["M"]);
  ctx.launch({"splat_split", "splat_split_scores", ""}, items(n), {rows, 9 * rows + 32.0 * static_cast<double>(n)},
             a.visible.ids, a.intersections.touched, a.offsets, a.visible.records,
             written_somewhere(a.intersections.rows), written(a.scores), n, static_cast<float>(a.most_pixels));
}

void add_scores(Context& ctx, const Tensor& fresh, const Tensor& scores) {
  const long k = Dims().bind("fresh", fresh, {"K"}).bind("scores", scores, {"K"})["K"];
  const auto count = static_cast<double>(k);
  ctx.launch({"splat_split", "splat_split_add", ""}, items(k), {count, 12 * count}, fresh, written(scores), k);
}

long splat_split(Context& ctx, const SplatSplit& a) {
  const long K = a.count, capacity = a.all.x.count();
  if (K < 0 || a.grow_to < K || a.grow_to > capacity)
    fail(Status::internal, "splat_split: {} Gaussians to {}, room for {}", K, a.grow_to, capacity);
  if (K == 0) return 0;
  Dims d;
  d.set("K", K).bind("scores", a.scores, {"K"});
  const SplatParameters &x = a.all.x, &m = a.all.m, &v = a.all.v;
  const Tensor ranks = ctx.tensor({K}, Type::f32, "split.ranks"), free = ctx.tensor({K}, Type::u32, "split.free");
  ctx.launch({"splat_split", "splat_split_rank", ""}, items(K), {}, x.logits, a.scores, written(ranks), written(free),
             K);
  Halves h;
  h.count = K;
  h.slots = compact(ctx, free, K / 2);
  h.free = h.slots.count();
  h.splits = std::min(h.free + a.grow_to - K, K - h.free);
  if (h.splits == 0) return K;
  const Tensor flags = ctx.tensor({K}, Type::u32, "split.flags");
  top_k(ctx, {ranks, h.splits, flags, {}});
  h.sources = compact(ctx, flags, h.splits);
  ctx.launch({"splat_split", "splat_split", ""}, items(h.splits), {}, h.sources, h.slots, written_somewhere(x.means),
             written_somewhere(x.log_scales), x.quats, written_somewhere(x.logits), K, h.free, h.splits);
  copy_rows(ctx, h, {}, m.means, v.means);
  copy_rows(ctx, h, {}, m.log_scales, v.log_scales);
  copy_rows(ctx, h, {}, m.logits, v.logits);
  copy_rows(ctx, h, x.quats, m.quats, v.quats);
  copy_rows(ctx, h, x.sh, m.sh, v.sh);
  return K + std::max(h.splits - h.free, 0L);
}

}  // namespace vsplat

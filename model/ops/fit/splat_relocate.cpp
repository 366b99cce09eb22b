#include "model/ops/fit/splat_relocate.h"

#include <algorithm>

#include "model/base/rng.h"
#include "model/ops/render/scan.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr double kWeights = 4294967040.0;  // below 2^32

SplatParameters first(const SplatParameters& x, long n) {
  return {x.means.first(n), x.log_scales.first(n), x.quats.first(n), x.logits.first(n), x.sh.first(n)};
}

// Points in the row of weights, and the Gaussians that go there.
struct Points {
  Tensor starts, slots;
  long moving = 0, count = 0;
  unsigned offset = 0;
};

void copy_rows(Context& ctx, const Points& p, const Tensor& sources, long K, const Tensor& x, const Tensor& m,
               const Tensor& v) {
  const long width = x.count() / x.dim(0);
  ctx.launch({"splat_relocate", "splat_relocate_copy", ""}, groups((width + 15) / 16, 16, p.count), {}, sources,
             p.slots, written_somewhere(x), written_somewhere(m), written_somewhere(v), K, p.moving,
             static_cast<unsigned>(p.count), width);
}

}  // namespace

SplatState first(const SplatState& all, long count) {
  return {first(all.x, count), first(all.m, count), first(all.v, count)};
}

long splat_relocate(Context& ctx, const SplatRelocate& a) {
  const long K = a.count, capacity = a.all.x.count();
  if (K < 0 || a.grow_to < K || a.grow_to > capacity)
    fail(Status::internal, "splat_relocate: {} Gaussians to {}, room for {}", K, a.grow_to, capacity);
  if (K == 0) return 0;
  const Tensor weights = ctx.tensor({K}, Type::u32, "relocate.weights");
  const Tensor moving = ctx.tensor({K}, Type::u32, "relocate.moving");
  const auto finest = static_cast<unsigned>(std::min(kWeights / static_cast<double>(K) - 1, 65535.0));
  ctx.launch({"splat_relocate", "splat_relocate_weigh", ""}, items(K), {}, a.all.x.logits, written(weights),
             written(moving), K, finest);
  Points p;
  p.starts = ctx.tensor({K + 1}, Type::u32, "relocate.starts");
  const Tensor nth = ctx.tensor({K + 1}, Type::u32, "relocate.nth");
  exclusive_scan(ctx, weights, p.starts);
  exclusive_scan(ctx, moving, nth);
  // The number of Gaussians that move determines the sizes below.
  const Tensor totals = ctx.tensor({2}, Type::u32, "relocate.totals");
  ctx.launch({"splat_relocate", "splat_relocate_totals", ""}, items(1, 1), {}, p.starts, nth, written(totals), K);
  const std::vector<std::uint32_t> total =
      ctx.planning() ? std::vector<std::uint32_t>{1u, static_cast<unsigned>(K)} : ctx.read<std::uint32_t>(totals);
  if (total[0] == 0) return K;
  p.moving = static_cast<long>(total[1]);
  p.count = p.moving + a.grow_to - K;
  if (p.count == 0) return K;
  const auto random = philox4x32_10({0, a.draw, stream_of("fit.relocation"), 0}, rng_key(a.seed));
  p.offset = static_cast<unsigned>((static_cast<std::uint64_t>(random[0]) * total[0]) >> 32);
  p.slots = ctx.tensor({std::max(p.moving, 1L)}, Type::u32, "relocate.slots");
  ctx.launch({"splat_relocate", "splat_relocate_slots", ""}, items(K), {}, moving, nth, written_somewhere(p.slots), K);
  const Tensor sources = ctx.tensor({p.count}, Type::u32, "relocate.sources");
  const SplatParameters &x = a.all.x, &m = a.all.m, &v = a.all.v;
  ctx.launch({"splat_relocate", "splat_relocate_move", ""}, items(p.count), {}, p.starts, p.slots,
             written_somewhere(x.logits), written_somewhere(x.log_scales), written_somewhere(m.logits),
             written_somewhere(v.logits), written_somewhere(m.log_scales), written_somewhere(v.log_scales),
             written(sources), K, p.moving, static_cast<unsigned>(p.count), p.offset);
  copy_rows(ctx, p, sources, K, x.means, m.means, v.means);
  copy_rows(ctx, p, sources, K, x.quats, m.quats, v.quats);
  copy_rows(ctx, p, sources, K, x.sh, m.sh, v.sh);
  ctx.launch({"splat_relocate", "splat_relocate_sources", ""}, items(K), {}, p.starts, written_somewhere(x.logits),
             written_somewhere(x.log_scales), written_somewhere(m.logits), written_somewhere(v.logits),
             written_somewhere(m.log_scales), written_somewhere(v.log_scales), K, static_cast<unsigned>(p.count),
             p.offset);
  return a.grow_to;
}

void splat_noise(Context& ctx, const SplatNoise& a) {
  Dims d;
  d.bind("means", a.x.means, {"K", "3"}).bind("log_scales", a.x.log_scales, {"K", "3"});
  d.bind("quats", a.x.quats, {"K", "4"}).bind("logits", a.x.logits, {"K"});
  const auto key = rng_key(a.seed);
  const auto count = static_cast<double>(d["K"]);
  ctx.launch({"splat_relocate", "splat_relocate_noise", ""}, items(d["K"]), {100 * count, 60 * count},
             written(a.x.means), a.x.log_scales, a.x.quats, a.x.logits, d["K"], a.rate, a.draw, stream_of("fit.noise"),
             key[0], key[1]);
}

}  // namespace vsplat

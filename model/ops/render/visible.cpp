#include "model/ops/render/visible.h"

#include <algorithm>
#include <bit>

#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// A CPU's work-items each process a large block; a GPU has many work-items.
long block_of(const Context& ctx, long k) {
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const long items = cpu ? 8L * std::max(ctx.device().compute_units, 1) : 4096;
  const auto even = static_cast<std::uint64_t>(std::max(k / items, 1L));
  return static_cast<long>(std::clamp<std::uint64_t>(std::bit_ceil(even), cpu ? 1024 : 64, 1 << 16));
}

Range range_of(const Context& ctx, long blocks) { return items(blocks, ctx.flavour() == Flavour::cpu ? 1 : 32); }

}  // namespace

Culled make_culled(Context& ctx, long k) {
  const long block = block_of(ctx, k);
  return {ctx.tensor({k, 2}, Type::u32, "splat.rects"), ctx.tensor({k}, Type::u32, "splat.keys"),
          ctx.tensor({(k + block - 1) / block, 4}, Type::u64, "splat.sums")};
}

VisibleCount count_visible(Context& ctx, const Culled& culled, const Part& part) {
  const long k =
      Dims().bind("rects", culled.rects, {"K", "2"}, Type::u32).bind("keys", culled.keys, {"K"}, Type::u32)["K"];
  VisibleCount out;
  out.block = block_of(ctx, k);
  const long blocks = (k + out.block - 1) / out.block;
  out.before.assign(static_cast<std::size_t>(blocks) + 1, 0);
  const bool wide = ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4;
  ctx.launch({"visible", "visible_count", wide ? "-DWIDE" : ""}, range_of(ctx, blocks),
             {0, 12.0 * static_cast<double>(k)}, culled.rects, culled.keys, written(culled.sums), k, out.block, blocks,
             static_cast<unsigned>(part.x0), static_cast<unsigned>(part.x1), static_cast<unsigned>(part.y0),
             static_cast<unsigned>(part.y1));
  if (ctx.planning()) return out;
  const auto sums = ctx.read<std::uint64_t>(culled.sums);
  out.least_key = 0xffffffffu;
  for (std::size_t b = 0; b < static_cast<std::size_t>(blocks); ++b) {
    out.gaussians += sums[4 * b];
    out.intersections += sums[4 * b + 1];
    out.least_key = std::min(out.least_key, static_cast<std::uint32_t>(sums[4 * b + 2]));
    out.largest_key = std::max(out.largest_key, static_cast<std::uint32_t>(sums[4 * b + 3]));
    out.before[b + 1] = out.gaussians;
  }
  if (out.gaussians == 0) out.least_key = out.largest_key = 0;
  return out;
}

Projected compact_visible(Context& ctx, const Culled& culled, const Part& part, const VisibleCount& count,
                          long record) {
  const long k =
      Dims().bind("rects", culled.rects, {"K", "2"}, Type::u32).bind("keys", culled.keys, {"K"}, Type::u32)["K"];
  const long n = static_cast<long>(count.gaussians), blocks = (k + count.block - 1) / count.block;
  Projected out;
  out.ids = ctx.tensor({n}, Type::u32, "splat.ids");
  out.rects = ctx.tensor({n, 2}, Type::u32, "splat.rects");
  out.keys = ctx.tensor({n}, Type::u32, "splat.keys");
  out.records = ctx.tensor({n, record}, Type::f32, "splat.records");
  out.key_bits = std::bit_width(count.largest_key - count.least_key);
  ctx.launch({"visible", "visible_compact", ""}, range_of(ctx, blocks),
             {0, 8.0 * static_cast<double>(k) + 20.0 * static_cast<double>(n)}, culled.rects, culled.keys, culled.sums,
             written(out.ids), written(out.rects), written(out.keys), k, count.block, blocks,
             static_cast<unsigned>(count.least_key), static_cast<unsigned>(part.x0), static_cast<unsigned>(part.x1),
             static_cast<unsigned>(part.y0), static_cast<unsigned>(part.y1));
  return out;
}

}  // namespace vsplat

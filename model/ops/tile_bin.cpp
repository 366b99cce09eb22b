#include "model/ops/tile_bin.h"

#include <bit>
#include <numeric>

#include "model/ops/radix_sort.h"
#include "model/ops/scan.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kSumBlock = 1024;

}  // namespace

std::uint64_t count_intersections(Context& ctx, const Projected& p) {
  const long k = Dims().bind("counts", p.counts, {"K"}, Type::u32)["K"];
  const long blocks = (k + kSumBlock - 1) / kSumBlock;
  const Tensor sums = ctx.tensor({blocks}, Type::u64, "tile_bin.sums");
  ctx.launch({"tile_bin", "tile_bin_total", ""}, items(blocks), {0, 4.0 * static_cast<double>(k)}, p.counts, sums,
             static_cast<int>(k), static_cast<int>(kSumBlock), static_cast<int>(blocks));
  if (ctx.planning()) return 0;
  const auto parts = ctx.read<std::uint64_t>(sums);
  return std::accumulate(parts.begin(), parts.end(), std::uint64_t{0});
}

Binned tile_bin(Context& ctx, const Projected& p, std::uint64_t count, int width, int height) {
  Dims d;
  d.bind("rects", p.rects, {"K", "2"}, Type::u32)
      .bind("counts", p.counts, {"K"}, Type::u32)
      .bind("keys", p.keys, {"K"}, Type::u32);
  const long k = d["K"], tiles_x = tiles_along(width), tiles = tiles_x * tiles_along(height);
  if (count >= (std::uint64_t{1} << 31) || tiles >= (1L << 31))
    fail(Status::memory,
         "a picture of {} x {} pixels: {} Gaussians touch its {} tiles {} times, at most 2147483647 can be sorted; "
         "draw it smaller "
         "or in parts",
         width, height, k, tiles, count);
  const long n = static_cast<long>(count);

  // Depth first, over the Gaussians only; then intersections are emitted near to far and sorted, stably, by tile alone.
  Tensor ids = radix_sort(ctx, p.keys, Tensor(), 32).values;
  const Tensor ordered = ctx.tensor({k}, Type::u32, "tile_bin.ordered");
  Tensor offsets = ctx.tensor({k + 1}, Type::u32, "tile_bin.offsets");
  const double kd = static_cast<double>(k), nd = static_cast<double>(n);
  ctx.launch({"tile_bin", "tile_bin_gather", ""}, items(k), {0, 12 * kd}, p.counts, ids, ordered, static_cast<int>(k));
  exclusive_scan(ctx, ordered, offsets);
  Tensor tile_keys = ctx.tensor({n}, Type::u32, "tile_bin.tiles");
  Tensor gaussians = ctx.tensor({n}, Type::u32, "tile_bin.gaussians");
  ctx.launch({"tile_bin", "tile_bin_emit", ""}, items(k), {0, 16 * kd + 8 * nd}, p.rects, ids, offsets, tile_keys,
             gaussians, static_cast<int>(k), static_cast<int>(tiles_x));
  ids = offsets = Tensor();
  const int bits = std::bit_width(static_cast<std::uint64_t>(tiles - 1));
  const Sorted sorted = radix_sort(ctx, std::move(tile_keys), std::move(gaussians), bits);
  Binned out{sorted.values, ctx.tensor({tiles + 1}, Type::u32, "tile_bin.starts")};
  ctx.launch({"tile_bin", "tile_bin_ranges", ""}, items(n + 1), {0, 4 * nd + 4.0 * static_cast<double>(tiles)},
             sorted.keys, out.starts, static_cast<unsigned>(n), static_cast<unsigned>(tiles));
  return out;
}

}  // namespace vsplat

#include "model/ops/render/tile_bin.h"

#include <algorithm>
#include <bit>

#include "model/ops/render/radix_sort.h"
#include "model/ops/render/scan.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

const char* defines_for(const Tensor& masks) { return masks ? "-DEXACT" : ""; }

Tensor counts_of(Context& ctx, const Tensor& rects, const Tensor& masks, const Tensor& order) {
  const long v = rects.dim(0);
  Tensor out = ctx.tensor({v}, Type::u32, "tile_bin.counts");
  ctx.launch({"tile_bin", "tile_bin_counts", defines_for(masks)}, items(v), {0, 16.0 * static_cast<double>(v)}, rects,
             masks, order, written(out), v);
  return out;
}

// The inputs of both flavours.
struct Job {
  Context& ctx;
  const Tensor& rects;
  const Tensor& masks;  // or none
  const Tensor& order;
  const Part& part;
  long v, n;
};

long blocks_at_most(const Context& ctx) { return 4L * std::max(ctx.device().compute_units, 1); }

Tensor pairs(const Job& j, const char* what) { return j.ctx.tensor({j.n}, Type::u32, what); }

void count_and_place(const Job& j, Binned& out) {
  Context& ctx = j.ctx;
  const long tiles = j.part.tiles();
  // Just enough blocks to distribute them evenly, since each counts every tile.
  const long most = blocks_at_most(ctx);
  const long block = std::max((j.v + most - 1) / most, 256L), blocks = std::max((j.v + block - 1) / block, 1L);
  const double v = static_cast<double>(j.v), n = static_cast<double>(j.n);
  const double table = 4.0 * static_cast<double>(blocks) * static_cast<double>(tiles);
  const long tiles_x = j.part.tiles_x();
  const Tensor histogram = ctx.tensor({most, tiles}, Type::u32, "tile_bin.histogram").first(blocks);
  const Tensor ordered = ctx.tensor({j.v, 2}, Type::u32, "tile_bin.ordered");
  const Tensor masks = j.masks ? ctx.tensor({j.v}, Type::u64, "tile_bin.ordered_masks") : Tensor();
  ctx.launch({"tile_bin", "tile_bin_order", defines_for(j.masks)},
             items(j.v, std::min(256L, static_cast<long>(ctx.device().max_work_group))), {0, 20 * v}, j.rects, j.masks,
             j.order, written(ordered), written(masks), j.v);
  {
    const Tensor totals = ctx.tensor({tiles}, Type::u32, "tile_bin.totals");
    ctx.launch({"tile_bin", "tile_bin_count", defines_for(j.masks)}, items(blocks, 1), {0, 8 * v + table}, ordered,
               masks, written(histogram), j.v, block, blocks, tiles_x, tiles);
    ctx.launch({"tile_bin", "tile_bin_totals", ""}, items(tiles), {0, table}, histogram, written(totals), blocks,
               tiles);
    exclusive_scan(ctx, totals, out.starts);
  }
  ctx.launch({"tile_bin", "tile_bin_place", ""}, items(tiles), {0, 2 * table}, written(histogram), out.starts, blocks,
             tiles);
  ctx.launch({"tile_bin", "tile_bin_scatter", defines_for(j.masks)}, items(blocks, 1), {0, 12 * v + 4 * n + table},
             ordered, masks, j.order, written(histogram), out.offsets, written(out.ids), written(out.slots), j.v, block,
             blocks, tiles_x, tiles, static_cast<unsigned>(j.n));
}

// Writes the pairs near to far, and sorts them stably by tile only.
void emit_and_sort(const Job& j, Binned& out) {
  Context& ctx = j.ctx;
  const long tiles = j.part.tiles();
  const double v = static_cast<double>(j.v), n = static_cast<double>(j.n);
  const unsigned N = static_cast<unsigned>(j.n);
  Tensor keys = pairs(j, "tile_bin.tiles");
  Tensor gaussians = pairs(j, "tile_bin.gaussians"), slots = out.slots ? pairs(j, "tile_bin.emitted_slots") : Tensor();
  {
    const Tensor emitted = ctx.tensor({j.v + 1}, Type::u32, "tile_bin.emitted");
    exclusive_scan(ctx, counts_of(ctx, j.rects, Tensor(), j.order), emitted);
    ctx.launch({"tile_bin", "tile_bin_emit", defines_for(j.masks)}, items(j.v), {0, 16 * v + 8 * n}, j.rects, j.masks,
               j.order, emitted, out.offsets, written(keys), written(gaussians), written(slots), j.v, j.part.tiles_x(),
               tiles);
  }
  const int bits = std::bit_width(static_cast<std::uint64_t>(std::max(tiles - (j.masks ? 0 : 1), 0L)));
  // If two arrays must follow the sort, their indices are sorted instead.
  const Sorted sorted = radix_sort(ctx, std::move(keys), slots ? Tensor() : gaussians, bits);
  const auto pick = [&](const Tensor& values, const Tensor& to) {
    ctx.launch({"tile_bin", "tile_bin_pick", ""}, items(j.n), {0, 12 * n}, sorted.values, values, written(to), N);
  };
  if (slots) {
    pick(gaussians, out.ids);
    pick(slots, out.slots);
  } else {
    out.ids = sorted.values;
  }
  ctx.launch({"tile_bin", "tile_bin_ranges", ""}, items(j.n + 1), {0, 4 * n + 4.0 * static_cast<double>(tiles)},
             sorted.keys, written(out.starts), N, static_cast<unsigned>(tiles));
}

}  // namespace

Binned tile_bin(Context& ctx, const Projected& p, std::uint64_t count, const Part& part, const BinOptions& options) {
  Dims d;
  d.bind("rects", p.rects, {"V", "2"}, Type::u32).bind("keys", p.keys, {"V"}, Type::u32);
  const long v = d["V"], tiles = part.tiles();
  if (count >= (std::uint64_t{1} << 31) || tiles >= (1L << 31))
    fail(Status::memory,
         "{} Gaussians touch the {} tiles of a picture's part {} times, at most 2147483647 can be sorted", v, tiles,
         count);
  const Tensor order = radix_sort(ctx, p.keys, Tensor(), p.key_bits).values;
  Tensor masks;
  if (options.exact) {
    d.bind("records", p.records, {"V", "12"});
    masks = ctx.tensor({v}, Type::u64, "tile_bin.masks");
    ctx.launch({"tile_bin", "tile_bin_masks", ""}, items(v),
               {30 * static_cast<double>(count), 64 * static_cast<double>(v)}, p.records, p.rects, written(masks), v,
               part.x0, part.y0);
  }
  const Job job{ctx, p.rects, masks, order, part, v, static_cast<long>(count)};
  Binned out;
  out.starts = ctx.tensor({tiles + 1}, Type::u32, "tile_bin.starts");
  if (options.slots) {
    out.offsets = ctx.tensor({v + 1}, Type::u32, "tile_bin.offsets");
    exclusive_scan(ctx, counts_of(ctx, p.rects, masks, Tensor()), out.offsets);
    out.slots = pairs(job, "tile_bin.slots");
  }
  if (ctx.flavour() == Flavour::cpu) {
    out.ids = ctx.tensor({job.n + blocks_at_most(ctx)}, Type::u32, "tile_bin.ids");
    count_and_place(job, out);
    out.ids = out.ids.first(job.n);
  } else {
    if (options.slots) out.ids = pairs(job, "tile_bin.ids");
    emit_and_sort(job, out);
  }
  return out;
}

}  // namespace vsplat

#include "model/ops/rasterize.h"

#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kRows = 4;  // of a tile that a work-item owns on a CPU

// A group owns a tile: as many items as the device lets it have, each with the fewest pixels.
KernelId gpu_kernel(Context& ctx, long& group) {
  for (long pixels = 1; pixels <= kTile; pixels *= 2) {
    group = kTile * kTile / pixels;
    const KernelId id{"rasterize", "rasterize_gpu", "-DPIXELS=" + std::to_string(pixels)};
    if (group > static_cast<long>(ctx.device().max_work_group)) continue;
    if (static_cast<std::size_t>(group) * 48 + 64 > ctx.device().local_memory) continue;
    if (static_cast<std::size_t>(group) <= ctx.max_work_group(id)) return id;
  }
  fail(Status::device,
       "rasterize: {} allows work-groups of {} items with {} bytes of local memory, {} with {} are needed",
       ctx.device().name, ctx.device().max_work_group, ctx.device().local_memory, kTile, 48 * kTile + 64);
}

}  // namespace

DevicePicture rasterize(Context& ctx, const Projected& p, const Binned& b, int width, int height,
                        const std::array<float, 3>& background) {
  const long tiles_x = tiles_along(width), tiles = tiles_x * tiles_along(height);
  Dims d;
  d.set("tiles + 1", tiles + 1);
  d.bind("records", p.records, {"K", "12"})
      .bind("ids", b.ids, {"N"}, Type::u32)
      .bind("starts", b.starts, {"tiles + 1"}, Type::u32);
  const DevicePicture out{ctx.tensor({height, width, 3}, Type::f32, "picture.colour"),
                          ctx.tensor({height, width}, Type::f32, "picture.alpha"),
                          ctx.tensor({height, width}, Type::f32, "picture.depth")};
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(out.alpha.count());
  // At most: every intersection over its whole tile.
  const Cost cost{n * kTile * kTile * 33.0, n * 52.0 + pixels * 20.0};
  const auto run = [&](const KernelId& id, const Range& range) {
    ctx.launch(id, range, cost, p.records, b.ids, b.starts, out.colour, out.alpha, out.depth, width, height,
               static_cast<int>(tiles_x), static_cast<int>(tiles), background[0], background[1], background[2]);
  };
  if (ctx.flavour() == Flavour::cpu) {
    run({"rasterize", "rasterize_cpu", "-DROWS=" + std::to_string(kRows)}, groups(tiles, kTile / kRows));
  } else {
    long group = 0;
    const KernelId id = gpu_kernel(ctx, group);
    run(id, groups(tiles, group));
  }
  return out;
}

}  // namespace vsplat

#include "model/ops/rasterize.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kBatch = 64;  // of a tile's Gaussians on a CPU

// A group owns a tile: as many items as the device lets it have, each with the fewest pixels.
KernelId gpu_kernel(Context& ctx, long& group) {
  for (long pixels = 1; pixels <= kTile; pixels *= 2) {
    group = kTile * kTile / pixels;
    const KernelId id{"rasterize", "rasterize_forward_gpu", "-DPIXELS=" + std::to_string(pixels)};
    if (group > static_cast<long>(ctx.device().max_work_group)) continue;
    if (static_cast<std::size_t>(group) * 48 + 64 > ctx.device().local_memory) continue;
    if (static_cast<std::size_t>(group) <= ctx.max_work_group(id)) return id;
  }
  fail(Status::device,
       "rasterize: {} allows work-groups of {} items with {} bytes of local memory, {} with {} are needed",
       ctx.device().name, ctx.device().max_work_group, ctx.device().local_memory, kTile, 48 * kTile + 64);
}

}  // namespace

DevicePicture make_picture(Context& ctx, int width, int height) {
  return {ctx.tensor({height, width, 3}, Type::f32, "picture.colour"),
          ctx.tensor({height, width}, Type::f32, "picture.alpha"),
          ctx.tensor({height, width}, Type::f32, "picture.depth")};
}

void rasterize(Context& ctx, const Projected& p, const Binned& b, const Part& part,
               const std::array<float, 3>& background, const DevicePicture& picture) {
  const long tiles = part.tiles();
  Dims d;
  d.set("tiles + 1", tiles + 1);
  d.bind("records", p.records, {"V", "12"})
      .bind("ids", b.ids, {"N"}, Type::u32)
      .bind("starts", b.starts, {"tiles + 1"}, Type::u32)
      .bind("colour", picture.colour, {"H", "W", "3"})
      .bind("alpha", picture.alpha, {"H", "W"})
      .bind("depth", picture.depth, {"H", "W"});
  if (part.x0 < 0 || part.y0 < 0 || part.x1 > tiles_along(d["W"]) || part.y1 > tiles_along(d["H"]))
    fail(Status::internal, "rasterize: a part that ends at tile {}, {} of {} x {} pixels", part.x1, part.y1, d["W"],
         d["H"]);
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  // How much of it is blended is known only when it is done: what must move at the least counts alone.
  const Cost cost{0, n * 52.0 + pixels * 20.0};
  const auto run = [&](const KernelId& id, const Range& range) {
    ctx.launch(id, range, cost, p.records, b.ids, b.starts, picture.colour, picture.alpha, picture.depth,
               static_cast<int>(d["W"]), static_cast<int>(d["H"]), part.x0, part.y0, static_cast<int>(part.tiles_x()),
               static_cast<int>(tiles), background[0], background[1], background[2]);
  };
  if (ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4) {
    run({"rasterize", "rasterize_forward_cpu", "-DBATCH=" + std::to_string(kBatch)}, groups(tiles, 1));
  } else {
    long group = 0;
    const KernelId id = gpu_kernel(ctx, group);
    run(id, groups(tiles, group));
  }
}

}  // namespace vsplat

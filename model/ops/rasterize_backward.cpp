#include "model/ops/rasterize_backward.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kBatch = 64;    // Gaussians of a tile that a work-item looks at together on a CPU
constexpr long kColumns = 10;  // of a row
constexpr long kPixels = 4;    // of a work-item, at the least: fewer items share a sum

std::size_t local_bytes(long group) {
  const auto items = static_cast<std::size_t>(group), parts = items / 16;
  return items * 52 + 4 * kColumns * (items + 2 * parts) + 64;
}

// A group owns a tile: as many items as the device lets it have, each with the fewest pixels.
KernelId gpu_kernel(Context& ctx, long& group) {
  for (long pixels = kPixels; pixels <= kTile; pixels *= 2) {
    group = kTile * kTile / pixels;
    const KernelId id{"rasterize_backward", "rasterize_backward_gpu", "-DPIXELS=" + std::to_string(pixels)};
    if (group > static_cast<long>(ctx.device().max_work_group)) continue;
    if (local_bytes(group) > ctx.device().local_memory) continue;
    if (static_cast<std::size_t>(group) <= ctx.max_work_group(id)) return id;
  }
  fail(Status::device,
       "rasterize_backward: {} allows work-groups of {} items with {} bytes of local memory, {} with {} are needed",
       ctx.device().name, ctx.device().max_work_group, ctx.device().local_memory, kTile, local_bytes(kTile));
}

}  // namespace

IntersectionGradients rasterize_backward(Context& ctx, const Projected& p, const Binned& b, const Part& part,
                                         const DevicePicture& picture, const PictureGradient& gradient,
                                         const std::array<float, 3>& background) {
  const long tiles = part.tiles();
  Dims d;
  d.set("tiles + 1", tiles + 1);
  d.bind("colour", picture.colour, {"H", "W", "3"}).bind("alpha", picture.alpha, {"H", "W"});
  d.bind("depth", picture.depth, {"H", "W"});
  d.bind("records", p.records, {"V", "12"})
      .bind("ids", b.ids, {"N"}, Type::u32)
      .bind("starts", b.starts, {"tiles + 1"}, Type::u32)
      .bind("slots", b.slots, {"N"}, Type::u32);
  d.bind_optional("gradient.colour", gradient.colour, {"H", "W", "3"});
  d.bind_optional("gradient.alpha", gradient.alpha, {"H", "W"});
  d.bind_optional("gradient.depth", gradient.depth, {"H", "W"});
  if (part.x0 < 0 || part.y0 < 0 || part.x1 > tiles_along(d["W"]) || part.y1 > tiles_along(d["H"]))
    fail(Status::internal, "rasterize_backward: a part that ends at tile {}, {} of {} x {} pixels", part.x1, part.y1,
         d["W"], d["H"]);
  const IntersectionGradients out{ctx.tensor({d["N"], kColumns}, Type::f32, "rasterize_backward.rows"),
                                  ctx.tensor({d["N"]}, Type::u8, "rasterize_backward.touched")};
  ctx.fill_zero(out.touched);
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  // As in drawing, what must move at the least counts alone.
  const Cost cost{0, n * (56.0 + 4.0 * kColumns + 1.0) + pixels * 40.0};
  const auto run = [&](const KernelId& id, const Range& range) {
    ctx.launch(id, range, cost, p.records, b.ids, b.starts, b.slots, picture.colour, picture.alpha, picture.depth,
               gradient.colour, gradient.alpha, gradient.depth, out.rows, out.touched, static_cast<int>(d["W"]),
               static_cast<int>(d["H"]), part.x0, part.y0, static_cast<int>(part.tiles_x()), static_cast<int>(tiles),
               background[0], background[1], background[2]);
  };
  if (ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4) {
    run({"rasterize_backward", "rasterize_backward_cpu", "-DBATCH=" + std::to_string(kBatch)}, groups(tiles, 1));
  } else {
    long group = 0;
    const KernelId id = gpu_kernel(ctx, group);
    run(id, groups(tiles, group));
  }
  return out;
}

}  // namespace vsplat

#include "model/ops/rasterize.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kBatch = 64;          // of a tile's Gaussians, that a work-item looks at together on a CPU
constexpr long kColumns = 10;        // of a row of IntersectionGradients
constexpr long kBackwardPixels = 4;  // of a work-item, at the least: fewer items share a sum

using LocalBytes = std::size_t (*)(long group);  // of a group of so many items

std::size_t forward_bytes(long group) { return static_cast<std::size_t>(group) * 48 + 64; }

std::size_t backward_bytes(long group) {
  const auto items = static_cast<std::size_t>(group), parts = items / 16;
  return items * 52 + 4 * kColumns * (items + 2 * parts) + 64;
}

// A group owns a tile: as many items as the device lets it have, each with the fewest pixels.
KernelId gpu_kernel(Context& ctx, const char* file, const char* kernel, long least_pixels, LocalBytes bytes,
                    long& group) {
  for (long pixels = least_pixels; pixels <= kTile; pixels *= 2) {
    group = kTile * kTile / pixels;
    const KernelId id{file, kernel, "-DPIXELS=" + std::to_string(pixels)};
    if (group > static_cast<long>(ctx.device().max_work_group)) continue;
    if (bytes(group) > ctx.device().local_memory) continue;
    if (static_cast<std::size_t>(group) <= ctx.max_work_group(id)) return id;
  }
  fail(Status::device, "{}: {} allows work-groups of {} items with {} bytes of local memory, {} with {} are needed",
       file, ctx.device().name, ctx.device().max_work_group, ctx.device().local_memory, kTile, bytes(kTile));
}

bool wide_cpu(const Context& ctx) { return ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4; }

// What both directions read.
void bind(Dims& d, const Projected& p, const Binned& b, const Part& part, const DevicePicture& picture,
          const char* name) {
  d.set("tiles + 1", part.tiles() + 1);
  d.bind("records", p.records, {"V", "12"})
      .bind("ids", b.ids, {"N"}, Type::u32)
      .bind("starts", b.starts, {"tiles + 1"}, Type::u32)
      .bind("colour", picture.colour, {"H", "W", "3"})
      .bind("alpha", picture.alpha, {"H", "W"})
      .bind("depth", picture.depth, {"H", "W"});
  if (part.x0 < 0 || part.y0 < 0 || part.x1 > tiles_along(d["W"]) || part.y1 > tiles_along(d["H"]))
    fail(Status::internal, "{}: a part that ends at tile {}, {} of {} x {} pixels", name, part.x1, part.y1, d["W"],
         d["H"]);
}

}  // namespace

DevicePicture make_picture(Context& ctx, int width, int height) {
  return {ctx.tensor({height, width, 3}, Type::f32, "picture.colour"),
          ctx.tensor({height, width}, Type::f32, "picture.alpha"),
          ctx.tensor({height, width}, Type::f32, "picture.depth")};
}

void rasterize_forward(Context& ctx, const RasterizeForward& a) {
  const Part& part = a.part;
  const long tiles = part.tiles();
  Dims d;
  bind(d, a.projected, a.binned, part, a.picture, "rasterize");
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  // How much of it is blended is known only when it is done: what must move at the least counts alone.
  const Cost cost{0, n * 52.0 + pixels * 20.0};
  const bool whole = part.tiles_x() == tiles_along(d["W"]) && tiles == tiles_along(d["W"]) * tiles_along(d["H"]);
  const auto drawn = [&](const Tensor& t) { return whole ? written(t) : written_somewhere(t); };
  const auto run = [&](const KernelId& id, const Range& range) {
    ctx.launch(id, range, cost, a.projected.records, a.binned.ids, a.binned.starts, drawn(a.picture.colour),
               drawn(a.picture.alpha), drawn(a.picture.depth), d["W"], d["H"], part.x0, part.y0, part.tiles_x(), tiles,
               a.background[0], a.background[1], a.background[2]);
  };
  if (wide_cpu(ctx)) {
    run({"rasterize", "rasterize_forward_cpu", "-DBATCH=" + std::to_string(kBatch)}, groups(tiles, 1));
  } else {
    long group = 0;
    const KernelId id = gpu_kernel(ctx, "rasterize", "rasterize_forward_gpu", 1, forward_bytes, group);
    run(id, groups(tiles, group));
  }
}

IntersectionGradients rasterize_backward(Context& ctx, const RasterizeBackward& a) {
  const Part& part = a.part;
  const PictureGradient& dp = a.dpicture;
  const long tiles = part.tiles();
  Dims d;
  bind(d, a.projected, a.binned, part, a.picture, "rasterize_backward");
  d.bind("slots", a.binned.slots, {"N"}, Type::u32);
  d.bind_optional("dpicture.colour", dp.colour, {"H", "W", "3"});
  d.bind_optional("dpicture.alpha", dp.alpha, {"H", "W"});
  d.bind_optional("dpicture.depth", dp.depth, {"H", "W"});
  const IntersectionGradients out{ctx.tensor({d["N"], kColumns}, Type::f32, "rasterize_backward.rows"),
                                  ctx.tensor({d["N"]}, Type::u8, "rasterize_backward.touched")};
  ctx.fill_zero(out.touched);
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  // As in drawing, what must move at the least counts alone.
  const Cost cost{0, n * (56.0 + 4.0 * kColumns + 1.0) + pixels * 40.0};
  const auto run = [&](const KernelId& id, const Range& range) {
    ctx.launch(id, range, cost, a.projected.records, a.binned.ids, a.binned.starts, a.binned.slots, a.picture.colour,
               a.picture.alpha, a.picture.depth, dp.colour, dp.alpha, dp.depth, written_somewhere(out.rows),
               written(out.touched), d["W"], d["H"], part.x0, part.y0, part.tiles_x(), tiles, a.background[0],
               a.background[1], a.background[2]);
  };
  if (wide_cpu(ctx)) {
    run({"rasterize_backward", "rasterize_backward_cpu", "-DBATCH=" + std::to_string(kBatch)}, groups(tiles, 1));
  } else {
    long group = 0;
    const KernelId id =
        gpu_kernel(ctx, "rasterize_backward", "rasterize_backward_gpu", kBackwardPixels, backward_bytes, group);
    run(id, groups(tiles, group));
  }
  return out;
}

}  // namespace vsplat

#include "model/ops/rasterize.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kColumns = 10;        // of a row of IntersectionGradients
constexpr long kBackwardPixels = 4;  // of a work-item, at the least: fewer items share a sum

std::size_t forward_bytes(long group) { return static_cast<std::size_t>(group) * 48 + 64; }

std::size_t backward_bytes(long group) {
  const auto items = static_cast<std::size_t>(group), parts = items / 16;
  return items * 52 + 4 * kColumns * (items + 2 * parts) + 64;
}

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
  check_part(part, d["W"], d["H"], name);
}

}  // namespace

bool rasterizes_in_blocks(const Context& ctx) {
  return ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4;
}

TileLaunch tile_launch(const TileKernel& kernel, Context& ctx) {
  for (long pixels = kernel.least_pixels; pixels <= kTile; pixels *= 2) {
    const long group = kTile * kTile / pixels;
    const KernelId id{kernel.file, kernel.name, "-DPIXELS=" + std::to_string(pixels) + kernel.defines};
    if (group > static_cast<long>(ctx.device().max_work_group)) continue;
    if (kernel.bytes(group) > ctx.device().local_memory) continue;
    if (static_cast<std::size_t>(group) <= ctx.max_work_group(id)) return {id, group};
  }
  fail(Status::device, "{}: {} allows work-groups of {} items with {} bytes of local memory, {} with {} are needed",
       kernel.file, ctx.device().name, ctx.device().max_work_group, ctx.device().local_memory, kTile,
       kernel.bytes(kTile));
}

void check_part(const Part& part, long width, long height, const char* operation) {
  if (part.x0 < 0 || part.y0 < 0 || part.x1 > tiles_along(width) || part.y1 > tiles_along(height))
    fail(Status::internal, "{}: a part that ends at tile {}, {} of {} x {} pixels", operation, part.x1, part.y1, width,
         height);
}

DevicePicture make_picture(Context& ctx, int width, int height, const SurfelMaps& maps) {
  const auto map = [&](bool wanted, const Shape& shape, const char* what) {
    return wanted ? ctx.tensor(shape, Type::f32, what) : Tensor();
  };
  return {ctx.tensor({height, width, 3}, Type::f32, "picture.colour"),
          ctx.tensor({height, width}, Type::f32, "picture.alpha"),
          ctx.tensor({height, width}, Type::f32, "picture.depth"),
          map(maps.normal, {height, width, 3}, "picture.normal"),
          map(maps.median, {height, width}, "picture.median"),
          map(maps.distortion, {height, width}, "picture.distortion"),
          map(maps.distortion, {height, width, 2}, "picture.moments")};
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
  if (rasterizes_in_blocks(ctx)) {
    run({"rasterize", "rasterize_forward_cpu", "-DBATCH=" + std::to_string(kRasterizeBatch)}, groups(tiles, 1));
  } else {
    const TileLaunch l = tile_launch({"rasterize", "rasterize_forward_gpu", "", 1, forward_bytes}, ctx);
    run(l.id, groups(tiles, l.group));
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
  const bool pulls = a.pulls != Pulls::none;
  const std::string flavour = !pulls ? "" : a.pulls == Pulls::through ? " -DPULL -DTHROUGH_CLAMP" : " -DPULL";
  const IntersectionGradients out{ctx.tensor({d["N"], pulls ? 2 : kColumns}, Type::f32, "rasterize_backward.rows"),
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
  if (rasterizes_in_blocks(ctx)) {
    run({"rasterize_backward", "rasterize_backward_cpu", "-DBATCH=" + std::to_string(kRasterizeBatch) + flavour},
        groups(tiles, 1));
  } else {
    const TileLaunch l =
        tile_launch({"rasterize_backward", "rasterize_backward_gpu", flavour, kBackwardPixels, backward_bytes}, ctx);
    run(l.id, groups(tiles, l.group));
  }
  return out;
}

}  // namespace vsplat

#include "model/ops/rasterize_surfels.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kColumns = 20;        // of a row of IntersectionGradients
constexpr long kBackwardPixels = 4;  // of a work-item, at the least: fewer items share a sum

std::size_t forward_bytes(long group) { return static_cast<std::size_t>(group) * 80 + 64; }

std::size_t backward_bytes(long group) {
  const auto items = static_cast<std::size_t>(group), parts = items / 16;
  return items * 84 + 4 * kColumns * (items + 2 * parts) + 64;
}

// What both directions read.
void bind(Dims& d, const Projected& p, const Binned& b, const Part& part, const DevicePicture& picture,
          const char* name) {
  d.set("tiles + 1", part.tiles() + 1);
  d.bind("records", p.records, {"V", "20"})
      .bind("ids", b.ids, {"N"}, Type::u32)
      .bind("starts", b.starts, {"tiles + 1"}, Type::u32)
      .bind("colour", picture.colour, {"H", "W", "3"})
      .bind("alpha", picture.alpha, {"H", "W"})
      .bind("depth", picture.depth, {"H", "W"});
  d.bind_optional("normal", picture.normal, {"H", "W", "3"});
  d.bind_optional("median", picture.median, {"H", "W"});
  d.bind_optional("distortion", picture.distortion, {"H", "W"});
  d.bind_optional("moments", picture.moments, {"H", "W", "2"});
  check_part(part, d["W"], d["H"], name);
}

std::string geometry(bool wanted) { return wanted ? " -DGEOMETRY" : ""; }

}  // namespace

void rasterize_surfels_forward(Context& ctx, const RasterizeSurfelsForward& a) {
  const Part& part = a.part;
  const DevicePicture& p = a.picture;
  const long tiles = part.tiles();
  Dims d;
  bind(d, a.projected, a.binned, part, p, "rasterize_surfels");
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  const auto each = [](const Tensor& map, double bytes) { return map ? bytes : 0.0; };
  // As in blending volumes, what must move at the least counts alone.
  const Cost cost{0, n * 84.0 + pixels * (20.0 + each(p.normal, 12) + each(p.median, 4) + each(p.distortion, 4) +
                                          each(p.moments, 8))};
  const bool whole = part.tiles_x() == tiles_along(d["W"]) && tiles == tiles_along(d["W"]) * tiles_along(d["H"]);
  const auto drawn = [&](const Tensor& t) { return whole ? written(t) : written_somewhere(t); };
  const auto run = [&](const KernelId& id, const Range& range) {
    ctx.launch(id, range, cost, a.projected.records, a.binned.ids, a.binned.starts, drawn(p.colour), drawn(p.alpha),
               drawn(p.depth), drawn(p.normal), drawn(p.median), drawn(p.distortion), drawn(p.moments), a.near,
               a.revision == SurfelRevision::current ? 1 : 0, d["W"], d["H"], part.x0, part.y0, part.tiles_x(), tiles,
               a.background[0], a.background[1], a.background[2]);
  };
  const std::string defines = geometry(p.normal || p.median || p.distortion || p.moments);
  if (rasterizes_in_blocks(ctx)) {
    run({"rasterize_surfels", "rasterize_surfels_forward_cpu", "-DBATCH=" + std::to_string(kRasterizeBatch) + defines},
        groups(tiles, 1));
  } else {
    const TileLaunch l =
        tile_launch({"rasterize_surfels", "rasterize_surfels_forward_gpu", defines, 1, forward_bytes}, ctx);
    run(l.id, groups(tiles, l.group));
  }
}

IntersectionGradients rasterize_surfels_backward(Context& ctx, const RasterizeSurfelsBackward& a) {
  const Part& part = a.part;
  const DevicePicture& p = a.picture;
  const PictureGradient& dp = a.dpicture;
  const long tiles = part.tiles();
  Dims d;
  bind(d, a.projected, a.binned, part, p, "rasterize_surfels_backward");
  d.bind("slots", a.binned.slots, {"N"}, Type::u32);
  d.bind_optional("dpicture.colour", dp.colour, {"H", "W", "3"});
  d.bind_optional("dpicture.alpha", dp.alpha, {"H", "W"});
  d.bind_optional("dpicture.depth", dp.depth, {"H", "W"});
  d.bind_optional("dpicture.normal", dp.normal, {"H", "W", "3"});
  d.bind_optional("dpicture.distortion", dp.distortion, {"H", "W"});
  if ((dp.normal && !p.normal) || (dp.distortion && !(p.distortion && p.moments)))
    fail(Status::internal, "rasterize_surfels_backward: a gradient by a map that was not drawn");
  const IntersectionGradients out{ctx.tensor({d["N"], kColumns}, Type::f32, "rasterize_backward.rows"),
                                  ctx.tensor({d["N"]}, Type::u8, "rasterize_backward.touched")};
  ctx.fill_zero(out.touched);
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  const bool more = dp.normal || dp.distortion;
  // As in drawing, what must move at the least counts alone.
  const Cost cost{0, n * (88.0 + 4.0 * kColumns + 1.0) + pixels * (more ? 80.0 : 40.0)};
  const auto run = [&](const KernelId& id, const Range& range) {
    ctx.launch(id, range, cost, a.projected.records, a.binned.ids, a.binned.starts, a.binned.slots, p.colour, p.alpha,
               p.depth, p.normal, p.distortion, p.moments, dp.colour, dp.alpha, dp.depth, dp.normal, dp.distortion,
               written_somewhere(out.rows), written(out.touched), a.near, a.revision == SurfelRevision::current ? 1 : 0,
               d["W"], d["H"], part.x0, part.y0, part.tiles_x(), tiles, a.background[0], a.background[1],
               a.background[2]);
  };
  if (rasterizes_in_blocks(ctx)) {
    run({"rasterize_surfels_backward", "rasterize_surfels_backward_cpu",
         "-DBATCH=" + std::to_string(kRasterizeBatch) + geometry(more)},
        groups(tiles, 1));
  } else {
    const TileLaunch l = tile_launch({"rasterize_surfels_backward", "rasterize_surfels_backward_gpu", geometry(more),
                                      kBackwardPixels, backward_bytes},
                                     ctx);
    run(l.id, groups(tiles, l.group));
  }
  return out;
}

}  // namespace vsplat

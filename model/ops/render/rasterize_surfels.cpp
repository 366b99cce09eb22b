#include "model/ops/render/rasterize_surfels.h"

#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr long kColumns = 20;  // of a row of IntersectionGradients

// Operations for a pixel and a surfel that it sees, counted as in rasterize.cpp. Both directions: the ray's
// intersection and alpha (43), transmittance and weight (3). Forward: five sums (9); with maps of the geometry 21 more.
// Backward: the gradients by weight, depth and alpha (20), by the surfel (13), and fifteen sums (22); with maps 28
// more.
constexpr double kSurfelFlops = 55, kSurfelMapsFlops = 21, kSurfelBackwardFlops = 101, kSurfelMapsBackwardFlops = 28;

std::string geometry(bool wanted) { return wanted ? " -DGEOMETRY" : ""; }

}  // namespace

void rasterize_surfels_forward(Context& ctx, const RasterizeSurfelsForward& a) {
  const Part& part = a.part;
  const DevicePicture& p = a.picture;
  const long tiles = part.tiles();
  Dims d;
  bind_blended(d, a.projected, a.binned, part, p, "20", "rasterize_surfels");
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  const auto each = [](const Tensor& map, double bytes) { return map ? bytes : 0.0; };
  // As for volumes, only the bytes that must move count.
  const bool maps = p.normal || p.median || p.distortion || p.moments;
  const double flops = kSurfelFlops + (maps ? kSurfelMapsFlops : 0);
  const Cost cost{
      0,
      n * 84.0 + pixels * (20.0 + each(p.normal, 12) + each(p.median, 4) + each(p.distortion, 4) + each(p.moments, 8)),
      0, most_blended(n, flops)};
  const bool whole = part.tiles_x() == tiles_along(d["W"]) && tiles == tiles_along(d["W"]) * tiles_along(d["H"]);
  const auto drawn = [&](const Tensor& t) { return whole ? written(t) : written_somewhere(t); };
  const TileLaunch l = tile_launch({"rasterize_surfels", "rasterize_surfels_forward_cpu",
                                    "rasterize_surfels_forward_gpu", geometry(maps), kSurfelRecord, 0, flops},
                                   ctx, tiles);
  ctx.launch(l.id, l.range, cost, a.projected.records, a.binned.ids, a.binned.starts, drawn(p.colour), drawn(p.alpha),
             drawn(p.depth), drawn(p.normal), drawn(p.median), drawn(p.distortion), drawn(p.moments), a.near,
             a.revision == SurfelRevision::current ? 1 : 0, d["W"], d["H"], part.x0, part.y0, part.tiles_x(), tiles,
             a.background[0], a.background[1], a.background[2]);
}

IntersectionGradients rasterize_surfels_backward(Context& ctx, const RasterizeSurfelsBackward& a) {
  const Part& part = a.part;
  const DevicePicture& p = a.picture;
  const PictureGradient& dp = a.dpicture;
  const long tiles = part.tiles();
  Dims d;
  bind_blended(d, a.projected, a.binned, part, p, "20", "rasterize_surfels_backward");
  bind_gradient(d, a.binned, dp);
  if ((dp.normal && !p.normal) || (dp.distortion && !(p.distortion && p.moments)))
    fail(Status::internal, "rasterize_surfels_backward: a gradient by a map that was not drawn");
  const IntersectionGradients out = make_rows(ctx, d["N"], kColumns);
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  const bool more = dp.normal || dp.distortion;
  // As in drawing, only the bytes that must move count.
  const double flops = kSurfelBackwardFlops + (more ? kSurfelMapsBackwardFlops : 0);
  const Cost cost{0, n * (88.0 + 4.0 * kColumns + 1.0) + pixels * (more ? 80.0 : 40.0), 0, most_blended(n, flops)};
  const TileLaunch l = tile_launch({"rasterize_surfels_backward", "rasterize_surfels_backward_cpu",
                                    "rasterize_surfels_backward_gpu", geometry(more), kSurfelRecord, kColumns, flops},
                                   ctx, tiles);
  ctx.launch(l.id, l.range, cost, a.projected.records, a.binned.ids, a.binned.starts, a.binned.slots, p.colour, p.alpha,
             p.depth, p.normal, p.distortion, p.moments, dp.colour, dp.alpha, dp.depth, dp.normal, dp.distortion,
             written_somewhere(out.rows), written(out.touched), a.near, a.revision == SurfelRevision::current ? 1 : 0,
             d["W"], d["H"], part.x0, part.y0, part.tiles_x(), tiles, a.background[0], a.background[1],
             a.background[2]);
  return out;
}

}  // namespace vsplat

#include "model/ops/networks/view_maps.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

void bind(Dims& d, const ViewDrawings& x, const char* what) {
  const std::string name = what;
  d.bind(name + ".colour", x.colour, {"n", "S", "S", "3"});
  d.bind(name + ".alpha", x.alpha, {"n", "S", "S"}).bind(name + ".depth", x.depth, {"n", "S", "S"});
}

void check_views(long first, const Dims& d) {
  if (first < 0 || first + d["n"] > d["V"])
    fail(Status::internal, "view_maps: views {} to {} of {}", first, first + d["n"], d["V"]);
}

}  // namespace

void view_maps_forward(Context& ctx, const ViewMapsForward& a) {
  Dims d;
  bind(d, a.drawings, "drawings");
  d.bind("images", a.images, {"V", "S", "S", "3"}).bind("maps", a.maps, {"V", "S", "S", "8"});
  check_views(a.first, d);
  const long view = d["S"] * d["S"], pixels = d["n"] * view;
  ctx.launch({"view_maps", "view_maps_forward", ""}, items(pixels), {0, 64.0 * static_cast<double>(pixels)}, a.images,
             a.drawings.colour, a.drawings.alpha, a.drawings.depth,
             written(a.maps, kViewMap * a.first * view, kViewMap * pixels), a.first * view, pixels,
             static_cast<long>(a.by_alpha));
}

void view_maps_backward(Context& ctx, const ViewMapsBackward& a) {
  Dims d;
  bind(d, a.drawings, "drawings");
  bind(d, a.ddrawings, "ddrawings");
  d.bind("dmaps", a.dmaps, {"V", "S", "S", "8"});
  check_views(a.first, d);
  const long view = d["S"] * d["S"], pixels = d["n"] * view;
  ctx.launch({"view_maps", "view_maps_backward", ""}, items(pixels), {0, 72.0 * static_cast<double>(pixels)},
             a.drawings.colour, a.drawings.alpha, a.drawings.depth, a.dmaps, written(a.ddrawings.colour),
             written(a.ddrawings.alpha), written(a.ddrawings.depth), a.first * view, pixels,
             static_cast<long>(a.by_alpha));
}

}  // namespace vsplat

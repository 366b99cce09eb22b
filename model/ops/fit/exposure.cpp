#include "model/ops/fit/exposure.h"

#include "runtime/column_sum.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kBlock = 256;  // BLOCK of cl/fit/exposure.cl

}  // namespace

void exposure_forward(Context& ctx, const ExposureForward& a) {
  Dims d;
  d.bind("map", a.map, {"12"}).bind("colour", a.drawn.colour, {"H", "W", "3"}).bind("alpha", a.drawn.alpha, {"H", "W"});
  d.bind("out", a.out, {"H", "W", "3"});
  const long pixels = d["H"] * d["W"];
  const auto count = static_cast<double>(pixels);
  ctx.launch({"exposure", "exposure_forward", ""}, items(pixels), {30 * count, 28 * count}, a.map, a.drawn.colour,
             a.drawn.alpha, written(a.out), pixels, a.background[0], a.background[1], a.background[2]);
}

void exposure_backward(Context& ctx, const ExposureBackward& a) {
  Dims d;
  d.bind("map", a.map, {"12"}).bind("colour", a.drawn.colour, {"H", "W", "3"}).bind("alpha", a.drawn.alpha, {"H", "W"});
  d.bind("dcolour", a.dpicture.colour, {"H", "W", "3"}).bind_optional("dalpha", a.dpicture.alpha, {"H", "W"});
  d.bind("dmap", a.dmap, {"12"});
  const long pixels = d["H"] * d["W"], blocks = (pixels + kBlock - 1) / kBlock;
  const auto count = static_cast<double>(pixels);
  const Tensor rows = ctx.tensor({blocks, 12}, Type::f32, "exposure.rows");
  ctx.launch({"exposure", "exposure_backward", ""}, items(blocks), {60 * count, 48 * count}, a.map, a.drawn.colour,
             a.drawn.alpha, written(a.dpicture.colour), written(a.dpicture.alpha), written(rows), pixels,
             a.background[0], a.background[1], a.background[2]);
  column_sum(ctx, {rows, a.dmap});
}

}  // namespace vsplat

#include "model/ops/fit/sky_background.h"

#include "runtime/column_sum.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kBlock = 256;  // BLOCK of cl/fit/sky_background.cl

// Binds what both directions read.
void bind_sky(Dims& d, const Tensor& sh, const Tensor& camera, const DevicePicture& drawn) {
  d.bind("sh", sh, {"25", "3"}).bind("camera", camera, {"1", "32"});
  d.bind("colour", drawn.colour, {"H", "W", "3"}).bind("alpha", drawn.alpha, {"H", "W"});
}

}  // namespace

void sky_background_forward(Context& ctx, const SkyBackgroundForward& a) {
  Dims d;
  bind_sky(d, a.sh, a.camera, a.drawn);
  d.bind("out", a.out, {"H", "W", "3"});
  const long pixels = d["H"] * d["W"];
  const auto count = static_cast<double>(pixels);
  if (ctx.flavour() == Flavour::cpu) {
    ctx.launch({"sky_background_cpu", "sky_background_forward", ""}, items(d["H"], 1), {260 * count, 28 * count}, a.sh,
               a.camera, a.drawn.colour, a.drawn.alpha, written(a.out), d["W"], d["H"]);
    return;
  }
  ctx.launch({"sky_background", "sky_background_forward", ""}, items(pixels), {260 * count, 28 * count}, a.sh, a.camera,
             a.drawn.colour, a.drawn.alpha, written(a.out), d["W"], pixels);
}

void sky_background_backward(Context& ctx, const SkyBackgroundBackward& a) {
  Dims d;
  bind_sky(d, a.sh, a.camera, a.drawn);
  d.bind("dcolour", a.dpicture.colour, {"H", "W", "3"}).bind("dalpha", a.dpicture.alpha, {"H", "W"});
  d.bind("dsh", a.dsh, {"25", "3"});
  const long pixels = d["H"] * d["W"], blocks = (pixels + kBlock - 1) / kBlock;
  const auto count = static_cast<double>(pixels);
  if (ctx.flavour() == Flavour::cpu) {
    const Tensor rows = ctx.tensor({d["H"], 3 * kSkyBasis}, Type::f32, "sky_background.rows");
    ctx.launch({"sky_background_cpu", "sky_background_backward", ""}, items(d["H"], 1), {500 * count, 28 * count}, a.sh,
               a.camera, a.drawn.alpha, a.dpicture.colour, written(a.dpicture.alpha), written(rows), d["W"], d["H"]);
    column_sum(ctx, {rows, a.dsh.reshaped({3 * kSkyBasis})});
    return;
  }
  ctx.launch({"sky_background", "sky_background_backward_alpha", ""}, items(pixels), {260 * count, 20 * count}, a.sh,
             a.camera, a.dpicture.colour, written(a.dpicture.alpha), d["W"], pixels);
  const Tensor rows = ctx.tensor({blocks, 3 * kSkyBasis}, Type::f32, "sky_background.rows");
  ctx.launch({"sky_background", "sky_background_backward_sh", ""}, groups((blocks + 31) / 32, 32, 3),
             {500 * count, 24 * count}, a.camera, a.drawn.alpha, a.dpicture.colour, written(rows), d["W"], pixels);
  column_sum(ctx, {rows, a.dsh.reshaped({3 * kSkyBasis})});
}

}  // namespace vsplat

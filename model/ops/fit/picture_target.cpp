#include "model/ops/fit/picture_target.h"

#include "runtime/rounding.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kPixelsOfItem = 1024;  // BLOCK of cl/fit/picture_target_cpu.cl

}  // namespace

void picture_target(Context& ctx, const PictureTarget& a) {
  Dims d;
  d.bind("given", a.given, {"H", "W", "4"}, Type::u8).bind_optional("known", a.known, {"H", "W"}, Type::u8);
  d.bind("colour", a.drawn.colour, {"H", "W", "3"}).bind("alpha", a.drawn.alpha, {"H", "W"});
  d.bind("target", a.target, {"H", "W", "3"}).bind_optional("dalpha", a.dalpha, {"H", "W"});
  const long pixels = d["H"] * d["W"];
  const auto count = static_cast<double>(pixels);
  const bool by_blocks = ctx.flavour() == Flavour::cpu && pixels % 4 == 0;
  ctx.launch({by_blocks ? "picture_target_cpu" : "picture_target", "picture_target", ""},
             by_blocks ? items(div_up(pixels, kPixelsOfItem), 1) : items(pixels), {20 * count, 37 * count}, a.given,
             a.known, a.drawn.colour, a.drawn.alpha, written(a.target), written(a.dalpha), pixels, a.background[0],
             a.background[1], a.background[2], pixels ? a.alpha_weight / static_cast<float>(pixels) : 0.0f);
}

}  // namespace vsplat

#include "model/diagnose/selftest/reference/rasterize.h"

#include <array>
#include <tuple>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/records_on_device.h"
#include "model/diagnose/selftest/reference/rasterize_backward.h"
#include "model/ops/render/rasterize.h"

namespace vsplat::selftest {
namespace {

// `pulls_alone`: of the gradients, those whose sums do not cancel where one Gaussian shows in a few pixels.
void rasterize_of(Checks& c, int width, int height, int per_tile, float opacity, bool pulls_alone = false) {
  const Records r = make_records(width, height, per_tile, opacity, 3);
  const std::array<float, 3> background{0.25f, 0.5f, 1};
  const auto [p, b, slots] = upload_records(c.ctx, r);
  const Part whole{0, 0, (width + 15) / 16, (height + 15) / 16};
  const DevicePicture picture{c.gap({height, width, 3}), c.gap({height, width}), c.gap({height, width})};
  rasterize_forward(c.ctx, {p, b, whole, background, picture});
  const ref::Blended want = ref::blend(r.records, r.ids, r.starts, width, height, background);
  c.close("colour", picture.colour, want.colour, 1e-5);
  c.close("alpha", picture.alpha, want.alpha, 1e-5);
  c.close("depth", picture.depth, want.depth, 1e-5);
  const std::size_t pixels = size_of(width, height);
  const auto by_colour = random_floats(3 * pixels, 5), by_alpha = random_floats(pixels, 6),
             by_depth = random_floats(pixels, 7);
  const PictureGradient by{c.up({height, width, 3}, by_colour), c.up({height, width}, by_alpha),
                           c.up({height, width}, by_depth)};
  c.keep();  // what is blended
  for (const auto& [pulls, kind, columns, what] :
       {std::tuple{Pulls::none, ref::RowKind::sums, 10, "backward"},
        {Pulls::held, ref::RowKind::pulls, 2, "pulls"},
        {Pulls::through, ref::RowKind::pulls_through_clamp, 2, "pulls through what is held"}}) {
    if (pulls_alone && pulls == Pulls::none) continue;
    const IntersectionGradients got = rasterize_backward(c.ctx, {p, b, whole, background, picture, by, pulls});
    const std::size_t each = size_of(columns);
    const auto sums = rows_in_order(c.ctx.read<float>(got.rows), c.ctx.read<std::uint8_t>(got.touched), slots, each);
    const auto wanted = [&, kind = kind] {
      return ref::blend_backward(r.records, r.ids, r.starts, width, height, background, by_colour, by_alpha, by_depth,
                                 kind);
    };
    c.close_by_column(what, sums, each, wanted, 2e-5);
  }
  if (pulls_alone) return;
  RasterizeBackward weighing{p, b, whole, background, picture, by};
  weighing.weigh = true;
  const IntersectionGradients got = rasterize_backward(c.ctx, weighing);
  std::vector<float> without_depth = r.records;
  for (std::size_t i = 3; i < without_depth.size(); i += 12) without_depth[i] = 0;
  const auto sums = rows_in_order(c.ctx.read<float>(got.rows), c.ctx.read<std::uint8_t>(got.touched), slots, 10);
  const auto wanted = [&] {
    return ref::blend_backward(without_depth, r.ids, r.starts, width, height, background, by_colour, by_alpha, by_depth,
                               ref::RowKind::sums);
  };
  c.close_by_column("weighed values", sums, 10, wanted, 2e-5);
}

void rasterize_all(Checks& c) {
  for (const int size : c.some({1, 7, 15, 16, 17, 31, 53}, {3})) rasterize_of(c, size, 40, 30, 0.8f);
  for (const int count : c.some({1, 63, 64, 65, 257}, {0, 2, 255, 256, 600})) rasterize_of(c, 33, 20, count, 0.3f);
  rasterize_of(c, 48, 32, 400, 1.0f);
  if (!c.all) return;
  for (const int size : {1, 15, 17, 33}) rasterize_of(c, 40, size, 30, 0.8f);
  rasterize_of(c, 33, 20, 65, 1.0f);
  rasterize_of(c, 7, 3, 1, 0.5f, true);
}

}  // namespace

VSPLAT_CASES(rasterize, {"rasterize", rasterize_all})

}  // namespace vsplat::selftest

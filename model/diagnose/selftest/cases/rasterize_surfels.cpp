#include "model/ops/render/rasterize_surfels.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/records_on_device.h"
#include "model/diagnose/selftest/inputs/surfel_blending.h"
#include "model/ops/render/rasterize.h"

namespace vsplat::selftest {
namespace {

DevicePicture gap_picture(Checks& c, long h, long w) {
  return {c.gap({h, w, 3}), c.gap({h, w}), c.gap({h, w}),   c.gap({h, w, 3}),
          c.gap({h, w}),    c.gap({h, w}), c.gap({h, w, 2})};
}

const std::array<float, 3> kBehindSurfels{0.25f, 0.5f, 1};

ref::SurfelOptions surfel_options(bool current) {
  ref::SurfelOptions o{{}, current};
  for (std::size_t i = 0; i < 3; ++i) o.options.background[i] = kBehindSurfels[i];
  return o;
}

void rasterize_surfels_of(Checks& c, int width, int height, int per_tile, float opacity, bool current) {
  const ref::SurfelOptions o = surfel_options(current);
  const Records r = make_surfel_records(width, height, per_tile, opacity, 3, o);
  const RecordsOnDevice d = upload_records(c.ctx, r, kSurfelNumbers);
  const DevicePicture got = gap_picture(c, height, width);
  rasterize_surfels_forward(c.ctx, {d.p,
                                    d.b,
                                    {0, 0, (width + 15) / 16, (height + 15) / 16},
                                    kBehindSurfels,
                                    got,
                                    static_cast<float>(o.options.near),
                                    revision_of(o)});
  const ref::SurfelFrame want = ref::blend_surfels(r.records, r.ids, r.starts, width, height, o);
  c.close("colour", got.colour, want.colour, 2e-5);
  c.close("alpha", got.alpha, want.alpha, 2e-5);
  c.close("depth", got.depth, want.depth, 2e-5);
  c.close("normal", got.normal, want.normal, 2e-5);
  c.close("median", got.median, want.median, 2e-5);
  c.close("distortion", got.distortion, want.distortion, 1e-4);
}

// By differences of the reference's maps.
void rasterize_surfels_backward_of(Checks& c, int width, int height, int count, bool low_pass, bool current) {
  const ref::SurfelOptions o = surfel_options(current);
  const Records r = smooth_surfels(width, height, count, low_pass);
  const RecordsOnDevice d = upload_records(c.ctx, r, kSurfelNumbers);
  const auto maps = SurfelCotangent::random(width, height);
  const DevicePicture picture = gap_picture(c, height, width);
  const Part whole{0, 0, (width + 15) / 16, (height + 15) / 16};
  const float near = static_cast<float>(o.options.near);
  rasterize_surfels_forward(c.ctx, {d.p, d.b, whole, kBehindSurfels, picture, near, revision_of(o)});
  c.keep();  // what is blended
  const PictureGradient by{c.up({height, width, 3}, maps.colour), c.up({height, width}, maps.alpha),
                           c.up({height, width}, maps.depth), c.up({height, width, 3}, maps.normal),
                           c.up({height, width}, maps.distortion)};
  const IntersectionGradients got =
      rasterize_surfels_backward(c.ctx, {d.p, d.b, whole, kBehindSurfels, picture, by, near, revision_of(o)});
  const std::vector<float> rows =
      rows_in_order(c.ctx.read<float>(got.rows), c.ctx.read<std::uint8_t>(got.touched), d.slots, kSurfelNumbers);
  c.close_by_column(
      "backward", as_floats(by_surfel_records(r, rows)), kSurfelNumbers,
      [&] { return surfel_differences(r, width, height, maps, o); }, 2e-5);
}

void rasterize_surfels_all(Checks& c) {
  for (const int size : c.some({1, 7, 15, 16, 17, 33}, {3, 31, 53}))
    rasterize_surfels_of(c, size, 40, 17, 0.8f, size % 4 == 3 || size == 16);
  for (const int count : c.some({1, 63, 65, 150}, {0, 3, 64, 257}))
    rasterize_surfels_of(c, 33, 20, count, count == 150 ? 1.0f : 0.3f, false);
  for (const bool current : {false, true}) {
    rasterize_surfels_backward_of(c, 17, 3, 7, false, current);
    rasterize_surfels_backward_of(c, 13, 11, 7, false, current);
    rasterize_surfels_backward_of(c, 2, 2, 5, true, current);
    if (!c.all) continue;
    rasterize_surfels_backward_of(c, 1, 1, 7, false, current);
    rasterize_surfels_backward_of(c, 16, 33, 7, false, current);
    rasterize_surfels_backward_of(c, 31, 7, 7, false, current);
    for (const int size : {1, 15, 17, 33}) rasterize_surfels_of(c, 40, size, 17, 0.8f, current);
  }
}

}  // namespace

VSPLAT_CASES(rasterize_surfels, {"rasterize_surfels", rasterize_surfels_all})

}  // namespace vsplat::selftest

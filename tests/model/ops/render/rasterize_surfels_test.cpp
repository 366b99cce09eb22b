#include "model/ops/render/rasterize_surfels.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/diagnose/selftest/inputs/records_on_device.h"
#include "model/diagnose/selftest/inputs/surfel_records.h"
#include "model/diagnose/selftest/reference/rasterize_surfels.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class RasterizeSurfels : public test::FlavourTest {
 protected:
  static std::vector<Tensor> maps_of(const DevicePicture& p) {
    return {p.colour, p.alpha, p.depth, p.normal, p.median, p.distortion, p.moments};
  }

  // Starts as NaN, so that what is not drawn shows.
  DevicePicture draw(const selftest::Records& c, const Part& part, int width, int height, const SurfelMaps& maps,
                     const ref::SurfelOptions& o) {
    const selftest::RecordsOnDevice d = selftest::upload_records(ctx(), c, 20);
    const DevicePicture out = make_picture(ctx(), width, height, maps);
    for (const Tensor& t : maps_of(out))
      if (t) ctx().write(t, std::vector<float>(static_cast<std::size_t>(t.count()), NAN).data());
    rasterize_surfels_forward(ctx(), {d.p, d.b, part, background, out, static_cast<float>(o.options.near),
                                      o.current ? SurfelRevision::current : SurfelRevision::lara});
    return out;
  }

  ref::SurfelOptions options(bool current) const {
    ref::SurfelOptions o{{}, current};
    for (std::size_t i = 0; i < 3; ++i) o.options.background[i] = background[i];
    return o;
  }

  const std::array<float, 3> background{0.25f, 0.5f, 1};
};

// The same bits whether other maps are drawn beside one or not.
TEST_P(RasterizeSurfels, DrawsWhatIsAskedFor) {
  const ref::SurfelOptions o = options(false);
  const selftest::Records c = selftest::make_surfel_records(37, 21, 20, 0.8f, 4, o);
  const Part whole{0, 0, 3, 2};
  const std::vector<Tensor> all = maps_of(draw(c, whole, 37, 21, {true, true, true}, o));
  for (const SurfelMaps& maps :
       {SurfelMaps{}, SurfelMaps{true, false, false}, SurfelMaps{false, true, false}, SurfelMaps{false, false, true}}) {
    const std::vector<Tensor> some = maps_of(draw(c, whole, 37, 21, maps, o));
    EXPECT_EQ(static_cast<bool>(some[3]), maps.normal);
    EXPECT_EQ(static_cast<bool>(some[4]), maps.median);
    EXPECT_EQ(static_cast<bool>(some[5]), maps.distortion);
    EXPECT_EQ(static_cast<bool>(some[6]), maps.distortion);
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (!some[i]) continue;
      EXPECT_EQ(ctx().read<float>(some[i]), ctx().read<float>(all[i])) << "map " << i;
    }
  }
}

// One that faces the camera all over the picture: alpha is known, and what of it is nearer than the near plane.
TEST_P(RasterizeSurfels, StopsAtThresholds) {
  selftest::Records c;
  for (int i = 0; i < 3; ++i)
    for (const float v : {8.0f, 8.0f, 0.0f, 2.0f, 1e-6f, 0.0f,  0.0f, 1e-6f, 0.0f,  0.0f,
                          0.0f, 0.0f, 1.0f, 1.0f, 1.0f,  1e30f, 0.0f, 0.0f,  -1.0f, 1e30f})
      c.records.push_back(v);
  c.ids = {0, 1, 2};
  c.starts = {0, 3};
  // 0.99 twice leaves 0.0001 less a rounding: the second would bring transmittance under 1e-4 and is not drawn.
  const DevicePicture got = draw(c, {0, 0, 1, 1}, 16, 16, {true, true, true}, options(false));
  for (const float a : ctx().read<float>(got.alpha)) EXPECT_EQ(a, 0.99f);
  for (const float z : ctx().read<float>(got.median)) EXPECT_EQ(z, 2.0f);
  for (const float d : ctx().read<float>(got.distortion)) EXPECT_EQ(d, 0.0f);
  // A plane whose depth goes as 1 / h: h falls with dx, and where it is 0 or less nothing is met.
  for (std::size_t i = 0; i < 3; ++i) c.records[20 * i + 8] = 0.4f;
  const DevicePicture tilted = draw(c, {0, 0, 1, 1}, 16, 16, {true, true, true}, options(true));
  const auto alpha = ctx().read<float>(tilted.alpha);
  for (std::size_t x = 0; x < 16; ++x) {
    const float h = 1 + 0.4f * (8 - (static_cast<float>(x) + 0.5f));
    EXPECT_EQ(alpha[16 * 5 + x] > 0, h > 0) << x;
  }
  for (const Tensor& map : maps_of(tilted))
    for (const float v : ctx().read<float>(map)) EXPECT_TRUE(std::isfinite(v));
}

TEST_P(RasterizeSurfels, RejectsBadShape) {
  Projected p;
  p.records = ctx().tensor({3, 20});
  Binned b;
  b.ids = ctx().tensor({3}, Type::u32);
  b.starts = ctx().tensor({3}, Type::u32);
  DevicePicture picture = make_picture(ctx(), 16, 16);
  const auto draw_part = [&](const Part& part) { rasterize_surfels_forward(ctx(), {p, b, part, background, picture}); };
  EXPECT_THROW(draw_part({0, 0, 1, 1}), Error);
  b.starts = ctx().tensor({2}, Type::u32);
  EXPECT_THROW(draw_part({0, 1, 1, 2}), Error);
  picture.normal = ctx().tensor({16, 15, 3});
  EXPECT_THROW(draw_part({0, 0, 1, 1}), Error);
  picture.normal = Tensor();
  p.records = ctx().tensor({3, 12});
  EXPECT_THROW(draw_part({0, 0, 1, 1}), Error);
}

VSPLAT_FLAVOURS(RasterizeSurfels);
VSPLAT_OPERATION(RasterizeSurfels, rasterize_surfels)

}  // namespace
}  // namespace vsplat

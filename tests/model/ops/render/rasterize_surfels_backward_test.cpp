#include <gtest/gtest.h>

#include <cmath>

#include "model/diagnose/selftest/inputs/records_on_device.h"
#include "model/diagnose/selftest/inputs/surfel_blending.h"
#include "model/diagnose/selftest/inputs/surfel_records.h"
#include "model/ops/render/rasterize_surfels.h"
#include "tests/support/counted.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using selftest::SurfelCotangent;

class RasterizeSurfelsBackward : public test::FlavourTest {
 protected:
  static SurfelRevision revision_of(const ref::SurfelOptions& o) {
    return o.current ? SurfelRevision::current : SurfelRevision::lara;
  }

  ref::SurfelOptions options(bool current) const {
    ref::SurfelOptions o{{}, current};
    for (std::size_t i = 0; i < 3; ++i) o.options.background[i] = background[i];
    return o;
  }

  // Rows in the order of ids, zeros where none was written.
  std::vector<float> run(const selftest::Records& c, int width, int height, const SurfelCotangent& by,
                         const ref::SurfelOptions& o) {
    const auto [p, b, slots] = selftest::upload_records(ctx(), c, selftest::kSurfelNumbers);
    const auto upload = [&](const std::vector<float>& v, const Shape& shape) {
      return selftest::upload_or_none(ctx(), v, shape);
    };
    const Part whole{0, 0, (width + 15) / 16, (height + 15) / 16};
    const float near = static_cast<float>(o.options.near);
    const DevicePicture picture =
        make_picture(ctx(), width, height, {!by.normal.empty(), false, !by.distortion.empty()});
    rasterize_surfels_forward(ctx(), {p, b, whole, background, picture, near, revision_of(o)});
    const PictureGradient gradient{upload(by.colour, {height, width, 3}), upload(by.alpha, {height, width}),
                                   upload(by.depth, {height, width}), upload(by.normal, {height, width, 3}),
                                   upload(by.distortion, {height, width})};
    const IntersectionGradients got =
        rasterize_surfels_backward(ctx(), {p, b, whole, background, picture, gradient, near, revision_of(o)});
    return selftest::rows_in_order(ctx().read<float>(got.rows), ctx().read<std::uint8_t>(got.touched), slots,
                                   selftest::kSurfelNumbers);
  }

  const std::array<float, 3> background{0.25f, 0.5f, 1};
};

// In a profiled run, and drawing does, too; results are the same to the bit.
TEST_P(RasterizeSurfelsBackward, CountsWhatItBlendsInAProfiledRun) {
  const int width = 53, height = 40;
  const ref::SurfelOptions o = options(false);
  const selftest::Records c = selftest::make_surfel_records(width, height, 60, 0.8f, 3, o);
  std::uint64_t pairs = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      ref::SurfelPixel pixel;
      const std::size_t across = (width + 15) / 16;
      const std::size_t tile = static_cast<std::size_t>(y / 16) * across + static_cast<std::size_t>(x / 16);
      for (std::uint32_t i = c.starts[tile]; i < c.starts[tile + 1]; ++i) {
        const ref::Meeting at =
            ref::meet_record(&c.records[selftest::kSurfelNumbers * std::size_t{c.ids[i]}], x + 0.5, y + 0.5, o);
        if (!(at.alpha > 0)) continue;
        if (!pixel.add(at, {0, 0, 0}, {0, 0, 0}, o.options.near)) break;
        ++pairs;
      }
    }
  SurfelCotangent by = SurfelCotangent::random(width, height);
  for (const bool maps : {true, false}) {
    if (!maps) by.normal.clear(), by.distortion.clear();
    const std::vector<float> plain = run(c, width, height, by, o);
    for (const char* direction : {"rasterize_surfels_forward", "rasterize_surfels_backward"}) {
      std::vector<float> counted;
      const ProfileRow row = test::profiled_row(ctx(), direction, [&] { counted = run(c, width, height, by, o); });
      EXPECT_EQ(plain, counted);
      EXPECT_EQ(row.counted, pairs) << direction;
      EXPECT_GT(row.flops, 50.0 * static_cast<double>(row.counted));
    }
  }
}

TEST_P(RasterizeSurfelsBackward, HandlesAnyNumberPerTile) {
  for (const int count : {0, 1, 63, 64, 65}) {
    const selftest::Records c = selftest::make_surfel_records(33, 20, count, 0.3f, 3, options(false));
    const SurfelCotangent by = SurfelCotangent::random(33, 20);
    const std::vector<float> rows = run(c, 33, 20, by, options(false));
    EXPECT_EQ(rows.size(), selftest::kSurfelNumbers * c.ids.size());
    EXPECT_TRUE(std::all_of(rows.begin(), rows.end(), [](float v) { return std::isfinite(v); }));
    // The sum over all of w dcolour is that over all pixels of dcolour times alpha.
    double sum = 0, want = 0;
    for (std::size_t i = 0; i < c.ids.size(); ++i) sum += rows[selftest::kSurfelNumbers * i + 13];
    const ref::SurfelFrame f = ref::blend_surfels(c.records, c.ids, c.starts, 33, 20, options(false));
    for (std::size_t i = 0; i < f.alpha.size(); ++i) want += f.alpha[i] * by.colour[3 * i];
    EXPECT_NEAR(sum, want, 1e-4 * (1 + std::abs(want)));
  }
}

TEST_P(RasterizeSurfelsBackward, TakesWhatIsNoneAsZeros) {
  const int width = 20, height = 33;
  const ref::SurfelOptions o = options(false);
  const selftest::Records c = selftest::make_surfel_records(width, height, 20, 0.8f, 4, o);
  const SurfelCotangent all = SurfelCotangent::random(width, height);
  for (std::vector<float> SurfelCotangent::*map :
       {&SurfelCotangent::colour, &SurfelCotangent::alpha, &SurfelCotangent::depth, &SurfelCotangent::normal,
        &SurfelCotangent::distortion}) {
    SurfelCotangent none = all, zeros = all;
    (none.*map).clear();
    std::fill((zeros.*map).begin(), (zeros.*map).end(), 0.0f);
    EXPECT_EQ(run(c, width, height, none, o), run(c, width, height, zeros, o));
  }
}

// Alpha held at 0.99 does not move with the surfel; its colour, depth and normal do.
TEST_P(RasterizeSurfelsBackward, HoldsAlphaAtItsLimit) {
  selftest::Records c;
  c.records = {8, 8, 0, 2, 1e-6f, 0, 0, 1e-6f, 0, 0, 50, 50, 1, 1, 1, 1e30f, 0, 0, -1, 1e30f};
  c.ids = {0};
  c.starts = {0, 1};
  SurfelCotangent by;
  by.colour.assign(768, 1.0f), by.depth.assign(256, 2.0f), by.normal.assign(768, 3.0f);
  const std::vector<float> got = run(c, 16, 16, by, options(false));
  EXPECT_EQ(got[0], 0.0f);
  EXPECT_NEAR(got[12], 2 * 256 * 0.99, 1e-3);
  for (std::size_t i = 13; i < 16; ++i) EXPECT_NEAR(got[i], 256 * 0.99, 1e-3);
  for (std::size_t i = 16; i < 19; ++i) EXPECT_NEAR(got[i], 3 * 256 * 0.99, 2e-3);
}

TEST_P(RasterizeSurfelsBackward, RejectsBadShape) {
  Projected p;
  p.records = ctx().tensor({5, selftest::kSurfelNumbers});
  Binned b;
  b.ids = ctx().tensor({5}, Type::u32);
  b.starts = ctx().tensor({2}, Type::u32);
  b.slots = ctx().tensor({5}, Type::u32);
  DevicePicture picture = make_picture(ctx(), 16, 16, {true, false, true});
  const auto run_with = [&](const PictureGradient& gradient, const Part& part) {
    rasterize_surfels_backward(ctx(), {p, b, part, background, picture, gradient});
  };
  const Part whole{0, 0, 1, 1};
  EXPECT_THROW(run_with({ctx().tensor({16, 15, 3}), {}, {}}, whole), Error);
  EXPECT_THROW(run_with({{}, {}, {}, {}, ctx().tensor({15, 16})}, whole), Error);
  EXPECT_THROW(run_with({}, Part{1, 0, 2, 1}), Error);
  picture.moments = Tensor();
  EXPECT_THROW(run_with({{}, {}, {}, {}, ctx().tensor({16, 16})}, whole), Error);
  b.slots = ctx().tensor({4}, Type::u32);
  EXPECT_THROW(run_with({}, whole), Error);
}

VSPLAT_FLAVOURS(RasterizeSurfelsBackward);

}  // namespace
}  // namespace vsplat

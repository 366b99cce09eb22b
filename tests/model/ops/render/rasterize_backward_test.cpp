#include "model/diagnose/selftest/reference/rasterize_backward.h"

#include <gtest/gtest.h>

#include "model/diagnose/selftest/inputs/records_on_device.h"
#include "model/diagnose/selftest/reference/rasterize.h"
#include "model/ops/render/rasterize.h"
#include "tests/support/compare.h"
#include "tests/support/counted.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class RasterizeBackward : public test::FlavourTest {
 protected:
  struct Upstream {
    std::vector<float> colour, alpha, depth;
  };

  static Upstream random_upstream(int width, int height) {
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    return {test::random_floats(3 * pixels, 5), test::random_floats(pixels, 6), test::random_floats(pixels, 7)};
  }

  // Rows in the order of ids, zeros where none was written.
  std::vector<float> run(const selftest::Records& c, int width, int height, const Upstream& up,
                         Pulls pulls = Pulls::none) {
    const auto [p, b, slots] = selftest::upload_records(ctx(), c);
    const auto upload = [&](const std::vector<float>& v, const Shape& shape) {
      return selftest::upload_or_none(ctx(), v, shape);
    };
    const Part whole{0, 0, (width + 15) / 16, (height + 15) / 16};
    const DevicePicture picture = make_picture(ctx(), width, height);
    rasterize_forward(ctx(), {p, b, whole, background, picture});
    const IntersectionGradients got = rasterize_backward(
        ctx(),
        {p,
         b,
         whole,
         background,
         picture,
         {upload(up.colour, {height, width, 3}), upload(up.alpha, {height, width}), upload(up.depth, {height, width})},
         pulls});
    return selftest::rows_in_order(ctx().read<float>(got.rows), ctx().read<std::uint8_t>(got.touched), slots,
                                   pulls == Pulls::none ? 10 : 2);
  }

  const std::array<float, 3> background{0.25f, 0.5f, 1};
};

TEST_P(RasterizeBackward, TakesWhatIsNoneAsZeros) {
  const int width = 20, height = 33;
  const selftest::Records c = selftest::make_records(width, height, 20, 0.8f, 4);
  const Upstream all = random_upstream(width, height);
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  for (int left_out = 0; left_out < 3; ++left_out) {
    Upstream none = all, zeros = all;
    (left_out == 0 ? none.colour : left_out == 1 ? none.alpha : none.depth).clear();
    (left_out == 0   ? zeros.colour
     : left_out == 1 ? zeros.alpha
                     : zeros.depth)
        .assign(left_out ? pixels : 3 * pixels, 0);
    EXPECT_EQ(run(c, width, height, none), run(c, width, height, zeros));
  }
}

// In a profiled run; its results are the same to the bit.
TEST_P(RasterizeBackward, CountsWhatItBlendsInAProfiledRun) {
  const selftest::Records c = selftest::make_records(70, 50, 100, 0.6f, 9);
  const Upstream up = random_upstream(70, 50);
  for (const Pulls pulls : {Pulls::none, Pulls::held, Pulls::through}) {
    const std::vector<float> plain = run(c, 70, 50, up, pulls);
    std::vector<float> counted;
    const ProfileRow row =
        test::profiled_row(ctx(), "rasterize_backward", [&] { counted = run(c, 70, 50, up, pulls); });
    EXPECT_EQ(plain, counted);
    EXPECT_EQ(row.counted, ref::blend(c.records, c.ids, c.starts, 70, 50, background).pairs);
    EXPECT_GT(row.flops, 40.0 * static_cast<double>(row.counted));
  }
}

// Alpha held at 0.99 does not move with the Gaussian; its colour and depth do.
TEST_P(RasterizeBackward, HoldsAlphaAtItsLimit) {
  selftest::Records c;
  c.records = {8, 8, 100, 2, 0, 0, -1e-9f, -1e-9f, 1, 1, 1, 0};
  c.ids = {0};
  c.starts = {0, 1};
  const std::vector<float> got = run(c, 16, 16, {std::vector<float>(768, 1.0f), {}, std::vector<float>(256, 2.0f)});
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(got[i], 0.0f);
  for (std::size_t i = 6; i < 10; ++i) EXPECT_NEAR(got[i], (i == 9 ? 2 : 1) * 256 * 0.99, 1e-3);
}

TEST_P(RasterizeBackward, RejectsBadShape) {
  Projected p;
  p.records = ctx().tensor({5, 12});
  Binned b;
  b.ids = ctx().tensor({5}, Type::u32);
  b.starts = ctx().tensor({2}, Type::u32);
  const DevicePicture picture{ctx().tensor({16, 16, 3}), ctx().tensor({16, 16}), ctx().tensor({16, 16})};
  const Part whole{0, 0, 1, 1};
  const auto run_with = [&](const PictureGradient& gradient, const Part& part) {
    rasterize_backward(ctx(), {p, b, part, background, picture, gradient});
  };
  b.slots = ctx().tensor({4}, Type::u32);
  EXPECT_THROW(run_with({}, whole), Error);
  b.slots = ctx().tensor({5}, Type::u32);
  EXPECT_THROW(run_with({ctx().tensor({16, 15, 3}), {}, {}}, whole), Error);
  EXPECT_THROW(run_with({{}, {}, ctx().tensor({15, 16})}, whole), Error);
  EXPECT_THROW(run_with({}, Part{1, 0, 2, 1}), Error);
}

VSPLAT_FLAVOURS(RasterizeBackward);

}  // namespace
}  // namespace vsplat

#include "model/ops/render/rasterize.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/diagnose/selftest/inputs/records_on_device.h"
#include "model/diagnose/selftest/reference/rasterize.h"
#include "tests/support/counted.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Rasterize : public test::FlavourTest {
 protected:
  // Starts as NaN, so that what is not drawn shows.
  DevicePicture draw(const selftest::Records& c, const Part& part, int width, int height,
                     const std::array<float, 3>& background) {
    const selftest::RecordsOnDevice d = selftest::upload_records(ctx(), c);
    const DevicePicture out = make_picture(ctx(), width, height);
    for (const Tensor& t : {out.colour, out.alpha, out.depth})
      ctx().write(t, std::vector<float>(static_cast<std::size_t>(t.count()), NAN).data());
    rasterize_forward(ctx(), {d.p, d.b, part, background, out});
    return out;
  }
};

// 0.99 twice leaves 0.0001 less a rounding: the second would bring transmittance under 1e-4 and is not drawn.
TEST_P(Rasterize, StopsBeforeTheThresholdIsPassed) {
  const std::vector<float> record{8, 8, 100, 2, 0, 0, -1e-9f, -1e-9f, 1, 1, 1, 0};
  selftest::Records c{{}, {0, 1, 2}, {0, 3}};
  for (int i = 0; i < 3; ++i) c.records.insert(c.records.end(), record.begin(), record.end());
  const DevicePicture got = draw(c, {0, 0, 1, 1}, 16, 16, {0, 0, 0});
  for (const float a : ctx().read<float>(got.alpha)) EXPECT_EQ(a, 0.99f);
}

// In a profiled run its operations come of a counter; what is drawn is the same to the bit.
TEST_P(Rasterize, CountsWhatItBlendsInAProfiledRun) {
  const int width = 53, height = 40;
  const selftest::Records c = selftest::make_records(width, height, 300, 0.9f, 5);
  const Part whole{0, 0, (width + 15) / 16, (height + 15) / 16};
  const DevicePicture plain = draw(c, whole, width, height, {0.25f, 0.5f, 1});
  DevicePicture counted;
  const auto again = [&] { counted = draw(c, whole, width, height, {0.25f, 0.5f, 1}); };
  const ProfileRow once = test::profiled_row(ctx(), "rasterize_forward", again);
  const ProfileRow twice = test::profiled_row(ctx(), "rasterize_forward", [&] { again(), ctx().finish(), again(); });
  EXPECT_EQ(ctx().read<float>(plain.colour), ctx().read<float>(counted.colour));
  EXPECT_EQ(ctx().read<float>(plain.alpha), ctx().read<float>(counted.alpha));
  EXPECT_EQ(ctx().read<float>(plain.depth), ctx().read<float>(counted.depth));
  const ref::Blended want = ref::blend(c.records, c.ids, c.starts, width, height, {0.25f, 0.5f, 1});
  EXPECT_EQ(once.counted, want.pairs);
  EXPECT_EQ(twice.counted, 2 * want.pairs);
  EXPECT_GT(once.flops, static_cast<double>(30 * want.pairs));
  EXPECT_EQ(twice.flops, 2 * once.flops);
  EXPECT_EQ(once.performed_flops, once.flops);
}

TEST_P(Rasterize, RejectsBadShape) {
  Projected p;
  p.records = ctx().tensor({3, 12});
  Binned b;
  b.ids = ctx().tensor({3}, Type::u32);
  b.starts = ctx().tensor({3}, Type::u32);
  const DevicePicture picture = make_picture(ctx(), 16, 16);
  EXPECT_THROW(rasterize_forward(ctx(), {p, b, {0, 0, 1, 1}, {0, 0, 0}, picture}), Error);
  b.starts = ctx().tensor({2}, Type::u32);
  EXPECT_THROW(rasterize_forward(ctx(), {p, b, {0, 1, 1, 2}, {0, 0, 0}, picture}), Error);
  p.records = ctx().tensor({3, 11});
  EXPECT_THROW(rasterize_forward(ctx(), {p, b, {0, 0, 1, 1}, {0, 0, 0}, picture}), Error);
}

VSPLAT_FLAVOURS(Rasterize);
VSPLAT_OPERATION(Rasterize, rasterize)

}  // namespace
}  // namespace vsplat

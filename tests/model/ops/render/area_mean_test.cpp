#include "model/ops/render/area_mean.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class AreaMeanOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(AreaMeanOp);
VSPLAT_OPERATION(AreaMeanOp, area_mean)

TEST_P(AreaMeanOp, MeansOfSquares) {
  for (const auto& [h, w] : {std::pair{0L, 5L}, {1L, 1L}, {3L, 7L}, {16L, 15L}, {17L, 31L}})
    for (const long c : {0L, 1L, 3L})  // 0: no dimension of channels
      for (const long k : {1L, 2L, 3L, 8L}) {
        const long channels = c == 0 ? 1 : c;
        const std::vector<float> x = test::random_floats(static_cast<std::size_t>(k * h * k * w * channels), 1);
        std::vector<double> want(static_cast<std::size_t>(h * w * channels));
        for (long i = 0; i < static_cast<long>(x.size()); ++i) {
          const long channel = i % channels, column = i / channels % (k * w), row = i / channels / (k * w);
          want[static_cast<std::size_t>((row / k * w + column / k) * channels + channel)] +=
              static_cast<double>(x[static_cast<std::size_t>(i)]) / static_cast<double>(k * k);
        }
        const auto shape = [c](long rows, long columns) {
          return c == 0 ? std::vector<long>{rows, columns} : std::vector<long>{rows, columns, c};
        };
        const Tensor out = ctx().upload(shape(h, w), std::vector<float>(want.size(), 9.0f));
        area_mean(ctx(), {ctx().upload(shape(k * h, k * w), x), out, static_cast<int>(k)});
        const std::vector<float> got = ctx().read<float>(out);
        ASSERT_EQ(got.size(), want.size());
        for (std::size_t i = 0; i < want.size(); ++i)
          EXPECT_NEAR(got[i], want[i], 1e-6) << h << " x " << w << " x " << c << " by " << k << " at " << i;
        if (k == 1) {
          EXPECT_EQ(got, x);
        }
      }
}

TEST_P(AreaMeanOp, RejectsBadShape) {
  const Tensor x = ctx().tensor({4, 6, 3});
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({2, 3, 3}), 1}), Error);
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({2, 2, 3}), 2}), Error);
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({2, 3, 1}), 2}), Error);
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({2, 3}), 2}), Error);
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({4, 6, 3}), 0}), Error);
}

}  // namespace
}  // namespace vsplat

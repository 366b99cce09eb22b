#include "model/ops/gather.h"

#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class Gather : public test::FlavourTest {};
VSPLAT_FLAVOURS(Gather);

TEST_P(Gather, RowsGoToTheirColumnsAndNowhereElse) {
  const std::vector<int> index = {4, 0, 6, 6, 1};
  for (const long c : {1L, 3L, 16L, 33L, 65L}) {
    const std::vector<float> x = test::random_floats(static_cast<std::size_t>(7 * c), 61);
    const long w = c + 3;
    std::vector<float> want(static_cast<std::size_t>(5 * w), 9.0f);
    for (long p = 0; p < 5; ++p) {
      for (long i = 0; i < c; ++i) {
        want[static_cast<std::size_t>(p * w + 2 + i)] =
            x[static_cast<std::size_t>(index[static_cast<std::size_t>(p)] * c + i)];
      }
    }
    const Tensor out = ctx().upload({5, w}, std::vector<float>(want.size(), 9.0f));
    gather_forward(ctx(), {ctx().upload({7, c}, x), ctx().upload({5}, index, Type::i32), out, 2});
    EXPECT_EQ(ctx().read<float>(out), want) << c;
  }
}

// The transpose of gathering, added to what is there; each row has one source at most, so the sum is one rounded once.
TEST_P(Gather, BackwardAddsToTheRowsThatWereRead) {
  const std::vector<int> index = {4, 0, -1, 6, 1};
  for (const long c : {1L, 3L, 16L, 33L, 65L}) {
    const long w = c + 3;
    const std::vector<float> dout = test::random_floats(static_cast<std::size_t>(5 * w), 63);
    std::vector<float> want = test::random_floats(static_cast<std::size_t>(7 * c), 64);
    const Tensor dx = ctx().upload({7, c}, want);
    for (std::size_t p = 0; p < index.size(); ++p) {
      for (long i = 0; i < c && index[p] >= 0; ++i) {
        want[static_cast<std::size_t>(index[p] * c + i)] +=
            dout[static_cast<std::size_t>(static_cast<long>(p) * w + 2 + i)];
      }
    }
    gather_backward(ctx(), {ctx().upload({5, w}, dout), ctx().upload({5}, index, Type::i32), dx, 2});
    EXPECT_EQ(ctx().read<float>(dx), want) << c;
  }
  const Tensor none = ctx().upload({2, 3}, std::vector<float>(6, 1.0f));
  gather_backward(ctx(), {ctx().tensor({0, 3}), ctx().tensor({0}, Type::i32), none});
  EXPECT_EQ(ctx().read<float>(none), std::vector<float>(6, 1.0f));
}

TEST_P(Gather, Gaussians) {
  Gaussians g;
  g.count = 9;
  g.sh_degree = 1;
  g.means = test::random_floats(27, 1);
  g.scales = test::random_floats(27, 2);
  g.quats = test::random_floats(36, 3);
  g.opacities = test::random_floats(9, 4);
  g.sh = test::random_floats(108, 5);
  const DeviceGaussians all = upload(ctx(), g);
  const Gaussians two = download(ctx(), gather(ctx(), all, ctx().upload({2}, std::vector<int>{8, 2}, Type::i32)));
  ASSERT_EQ(two.count, 2u);
  EXPECT_EQ(two.sh_degree, 1);
  const auto rows = [](const std::vector<float>& v, std::size_t size) {
    std::vector<float> out(v.begin() + static_cast<long>(8 * size), v.begin() + static_cast<long>(9 * size));
    out.insert(out.end(), v.begin() + static_cast<long>(2 * size), v.begin() + static_cast<long>(3 * size));
    return out;
  };
  EXPECT_EQ(two.means, rows(g.means, 3));
  EXPECT_EQ(two.scales, rows(g.scales, 3));
  EXPECT_EQ(two.quats, rows(g.quats, 4));
  EXPECT_EQ(two.opacities, rows(g.opacities, 1));
  EXPECT_EQ(two.sh, rows(g.sh, 12));
  EXPECT_EQ(gather(ctx(), all, ctx().tensor({0}, Type::i32)).count(), 0);
}

TEST_P(Gather, RejectsBadShape) {
  const Tensor index = ctx().tensor({2}, Type::i32);
  EXPECT_THROW(gather_forward(ctx(), {ctx().tensor({4, 3}), index, ctx().tensor({2, 4}), 2}), Error);
  EXPECT_THROW(gather_forward(ctx(), {ctx().tensor({4, 3}), index, ctx().tensor({3, 3})}), Error);
  EXPECT_THROW(gather_backward(ctx(), {ctx().tensor({2, 4}), index, ctx().tensor({4, 3}), 2}), Error);
  EXPECT_THROW(gather_backward(ctx(), {ctx().tensor({3, 3}), index, ctx().tensor({4, 3})}), Error);
}

}  // namespace
}  // namespace vsplat

#include "model/ops/dense/gather.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Gather : public test::FlavourTest {};
VSPLAT_FLAVOURS(Gather);
VSPLAT_OPERATION(Gather, gather)

TEST_P(Gather, NoIntegers) {
  const Tensor from = ctx().tensor({4}, Type::i32);
  EXPECT_EQ(gather_integers(ctx(), from, ctx().tensor({0}, Type::i32)).dim(0), 0);
  EXPECT_THROW(gather_integers(ctx(), ctx().tensor({4}), from), Error);
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
  const Gaussians two =
      download(ctx(), gather_forward(ctx(), all, ctx().upload({2}, std::vector<int>{8, 2}, Type::i32)));
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
  EXPECT_EQ(gather_forward(ctx(), all, ctx().tensor({0}, Type::i32)).count(), 0);
}

// Each tensor as a matrix of its own is, which the case checks.
TEST_P(Gather, BackwardOfGaussians) {
  const Tensor rows = ctx().upload({3}, std::vector<int>{8, 2, 3}, Type::i32);
  const auto make = [&](long k, std::uint32_t seed) {
    const auto field = [&](const Shape& shape, long each) {
      return ctx().upload(shape, test::random_floats(static_cast<std::size_t>(k * each), seed++));
    };
    return GaussianGradients{field({k, 3}, 3), field({k, 3}, 3), field({k, 4}, 4), field({k}, 1), field({k, 4, 3}, 12)};
  };
  const auto parts = [](const GaussianGradients& g) {
    return std::array{g.means, g.scales, g.quats, g.opacities, g.sh};
  };
  for (const bool with_sh : {true, false}) {
    GaussianGradients from = make(3, 71);
    if (!with_sh) from.sh = {};
    const GaussianGradients to = make(9, 81), alone = make(9, 81);
    gather_backward(ctx(), from, rows, to);
    for (std::size_t part = 0; part < 5; ++part) {
      const Tensor by = parts(from)[part], got = parts(alone)[part];
      if (by) gather_backward(ctx(), {by.reshaped({3, by.count() / 3}), rows, got.reshaped({9, got.count() / 9})});
      EXPECT_EQ(ctx().read<float>(parts(to)[part]), ctx().read<float>(got)) << part;
    }
  }
  const GaussianGradients to = make(9, 81);
  const std::vector<float> before = ctx().read<float>(to.means);
  gather_backward(ctx(), zero_gradients(ctx(), 0, 1), ctx().tensor({0}, Type::i32), to);
  EXPECT_EQ(ctx().read<float>(to.means), before);
  EXPECT_THROW(gather_backward(ctx(), make(3, 71), rows, zero_gradients(ctx(), 9, 0)), Error);  // another S
  EXPECT_THROW(gather_backward(ctx(), make(3, 71), rows, {}), Error);
}

TEST_P(Gather, RejectsBadShape) {
  const Tensor index = ctx().tensor({2}, Type::i32);
  EXPECT_THROW(gather_forward(ctx(), {ctx().tensor({4, 3}), index, ctx().tensor({2, 4}), 2}), Error);
  EXPECT_THROW(gather_forward(ctx(), {ctx().tensor({4, 3}), index, ctx().tensor({3, 3}), 0, 1, 2}), Error);
  EXPECT_THROW(gather_backward(ctx(), {ctx().tensor({3, 3}), index, ctx().tensor({4, 3}), 0, 1, 2}), Error);
  EXPECT_THROW(gather_forward(ctx(), {ctx().tensor({4, 3}), index, ctx().tensor({3, 3})}), Error);
  EXPECT_THROW(gather_backward(ctx(), {ctx().tensor({2, 4}), index, ctx().tensor({4, 3}), 2}), Error);
  EXPECT_THROW(gather_backward(ctx(), {ctx().tensor({3, 3}), index, ctx().tensor({4, 3})}), Error);
}

}  // namespace
}  // namespace vsplat

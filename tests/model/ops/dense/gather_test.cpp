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

// Into some rows of a longer matrix, and back out of them.
TEST_P(Gather, SomeRowsOfALongerMatrix) {
  const std::vector<int> index = {4, 0, 6};
  const std::vector<float> x = test::random_floats(7 * 5, 61);
  std::vector<float> want(8 * 5, 9.0f);
  for (std::size_t i = 0; i < 15; ++i) want[3 * 5 + i] = x[static_cast<std::size_t>(index[i / 5]) * 5 + i % 5];
  const Tensor out = ctx().upload({8, 5}, std::vector<float>(40, 9.0f)), rows = ctx().upload({3}, index, Type::i32);
  gather_forward(ctx(), {ctx().upload({7, 5}, x), rows, out, 0, 1, 3});
  EXPECT_EQ(ctx().read<float>(out), want);
  std::vector<float> sums = test::random_floats(7 * 5, 64);
  const Tensor dx = ctx().upload({7, 5}, sums);
  for (std::size_t i = 0; i < 15; ++i) sums[static_cast<std::size_t>(index[i / 5]) * 5 + i % 5] += want[3 * 5 + i];
  gather_backward(ctx(), {out, rows, dx, 0, 1, 3});
  EXPECT_EQ(ctx().read<float>(dx), sums);
  EXPECT_THROW(gather_forward(ctx(), {dx, rows, out, 0, 1, 6}), Error);
  EXPECT_THROW(gather_backward(ctx(), {out, rows, dx, 0, 1, 6}), Error);
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

TEST_P(Gather, BackwardOfGaussians) {
  const std::vector<int> index = {8, 2, 3};
  const Tensor rows = ctx().upload({3}, index, Type::i32);
  const auto field = [&](const Shape& shape, std::size_t k, std::uint32_t seed) {
    Shape whole = shape;
    whole.insert(whole.begin(), static_cast<long>(k));
    std::size_t n = k;
    for (const long size : shape) n *= static_cast<std::size_t>(size);
    return ctx().upload(whole, test::random_floats(n, seed));
  };
  const auto make = [&](std::size_t k, std::uint32_t seed) {
    return GaussianGradients{field({3}, k, seed), field({3}, k, seed + 1), field({4}, k, seed + 2),
                             field({}, k, seed + 3), field({4, 3}, k, seed + 4)};
  };
  const auto parts = [](const GaussianGradients& g) {
    return std::vector<Tensor>{g.means, g.scales, g.quats, g.opacities, g.sh};
  };
  const auto check = [&](const GaussianGradients& from, const GaussianGradients& to) {
    std::vector<std::vector<float>> want;
    for (std::size_t part = 0; part < 5; ++part) {
      want.push_back(ctx().read<float>(parts(to)[part]));
      if (!parts(from)[part]) continue;
      const std::vector<float> added = ctx().read<float>(parts(from)[part]);
      const std::size_t c = added.size() / index.size();
      for (std::size_t i = 0; i < added.size(); ++i)
        want.back()[static_cast<std::size_t>(index[i / c]) * c + i % c] += added[i];
    }
    gather_backward(ctx(), from, rows, to);
    for (std::size_t part = 0; part < 5; ++part) EXPECT_EQ(ctx().read<float>(parts(to)[part]), want[part]) << part;
  };
  GaussianGradients from = make(3, 71);
  const GaussianGradients to = make(9, 81);
  check(from, to);
  from.sh = {};
  check(from, to);
  from = zero_gradients(ctx(), 0, 1);
  const std::vector<float> before = ctx().read<float>(to.means);
  gather_backward(ctx(), from, ctx().tensor({0}, Type::i32), to);
  EXPECT_EQ(ctx().read<float>(to.means), before);
  EXPECT_THROW(gather_backward(ctx(), make(3, 71), rows, zero_gradients(ctx(), 9, 0)), Error);  // another S
  EXPECT_THROW(gather_backward(ctx(), make(3, 71), rows, {}), Error);
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

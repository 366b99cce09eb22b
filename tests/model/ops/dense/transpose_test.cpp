#include "model/ops/dense/transpose.h"

#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class TransposeTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(TransposeTest);

TEST_P(TransposeTest, RowsBecomeColumns) {
  for (const auto& [a, b] : {std::pair{1L, 1L}, {1L, 7L}, {3L, 1L}, {15L, 17L}, {16L, 16L}, {17L, 33L}, {101L, 5L}}) {
    const auto rows = static_cast<std::size_t>(a), columns = static_cast<std::size_t>(b);
    const auto x = test::random_floats(rows * columns, 1), before = test::random_floats(rows * columns, 2);
    std::vector<float> want(x.size()), sum(before);
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t j = 0; j < columns; ++j) {
        want[j * rows + i] = x[i * columns + j];
        sum[j * rows + i] += x[i * columns + j];
      }
    const Tensor in = ctx().upload({a, b}, x), out = ctx().upload({b, a}, test::nans(x.size()));
    transpose(ctx(), {in, out});
    EXPECT_EQ(ctx().read<float>(out), want) << a << " x " << b;
    ctx().write(out, before.data());
    transpose(ctx(), {in, out, true});
    EXPECT_EQ(ctx().read<float>(out), sum) << a << " x " << b;
  }
  transpose(ctx(), {ctx().tensor({0, 3}), ctx().tensor({3, 0})});
}

TEST_P(TransposeTest, RejectsBadShape) {
  EXPECT_THROW(transpose(ctx(), {ctx().tensor({2, 3}), ctx().tensor({2, 3})}), Error);
}

}  // namespace
}  // namespace vsplat

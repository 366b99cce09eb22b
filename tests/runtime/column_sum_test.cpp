#include "runtime/column_sum.h"

#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class ColumnSumTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(ColumnSumTest);

TEST_P(ColumnSumTest, MatchesReferenceAtEverySizeThatBreaksThings) {
  for (const long rows : {1L, 3L, 63L, 64L, 65L, 4095L, 4096L, 4097L})
    for (const long c : {1L, 7L, 63L, 64L, 65L}) {
      const auto n = static_cast<std::size_t>(c);
      const auto x = test::random_floats(static_cast<std::size_t>(rows) * n, 1), before = test::random_floats(n, 2);
      std::vector<double> want(n), more(n);
      for (std::size_t i = 0; i < x.size(); ++i) want[i % n] += x[i];
      for (std::size_t i = 0; i < n; ++i) more[i] = want[i] + before[i];
      const Tensor from = ctx().upload({rows, c}, x), out = ctx().upload({c}, test::nans(n));
      column_sum(ctx(), {from, out});
      const auto first = ctx().read<float>(out);
      EXPECT_TRUE(test::close(first, want, 2e-6)) << rows << " x " << c;
      column_sum(ctx(), {from, out});
      EXPECT_EQ(ctx().read<float>(out), first) << "the same bits twice";
      ctx().write(out, before.data());
      column_sum(ctx(), {from, out, true});
      EXPECT_TRUE(test::close(ctx().read<float>(out), more, 2e-6)) << rows << " x " << c << " added";
    }
}

// Equal values always round in the same direction: added one by one in float, the sum would be off by some thousandths.
TEST_P(ColumnSumTest, LongSumsKeepTheirDigits) {
  const Tensor x = ctx().upload({1000003, 1}, std::vector<float>(1000003, 1.1f)), out = ctx().tensor({1});
  column_sum(ctx(), {x, out});
  EXPECT_TRUE(test::close(ctx().read<float>(out), std::vector<double>{1000003 * static_cast<double>(1.1f)}, 2e-6));
}

TEST_P(ColumnSumTest, OfNoRowsIsZero) {
  const Tensor none = ctx().tensor({0, 3}), out = ctx().upload({3}, std::vector<float>{1, 2, 3});
  column_sum(ctx(), {none, out, true});
  EXPECT_EQ(ctx().read<float>(out), (std::vector<float>{1, 2, 3}));
  column_sum(ctx(), {none, out});
  EXPECT_EQ(ctx().read<float>(out), (std::vector<float>{0, 0, 0}));
}

TEST_P(ColumnSumTest, RejectsBadShape) {
  EXPECT_THROW(column_sum(ctx(), {ctx().tensor({3, 4}), ctx().tensor({3})}), Error);
  EXPECT_THROW(column_sum(ctx(), {ctx().tensor({3, 4}, Type::i32), ctx().tensor({4})}), Error);
}

}  // namespace
}  // namespace vsplat

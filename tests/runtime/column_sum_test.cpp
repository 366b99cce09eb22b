#include "runtime/column_sum.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ColumnSumTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(ColumnSumTest);
VSPLAT_OPERATION(ColumnSumTest, column_sum)

// Equal values always round in the same direction: added one by one in float, the sum would be off by some thousandths.
TEST_P(ColumnSumTest, LongSumsKeepTheirDigits) {
  const Tensor x = ctx().upload({1000003, 1}, std::vector<float>(1000003, 1.1f)), out = ctx().tensor({1});
  column_sum(ctx(), {x, out});
  EXPECT_TRUE(test::close(ctx().read<float>(out), std::vector<double>{1000003 * static_cast<double>(1.1f)}, 2e-6));
}

TEST_P(ColumnSumTest, RejectsBadShape) {
  EXPECT_THROW(column_sum(ctx(), {ctx().tensor({3, 4}), ctx().tensor({3})}), Error);
  EXPECT_THROW(column_sum(ctx(), {ctx().tensor({3, 4}, Type::i32), ctx().tensor({4})}), Error);
}

}  // namespace
}  // namespace vsplat

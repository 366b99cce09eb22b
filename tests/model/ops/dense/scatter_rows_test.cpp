#include "model/ops/dense/scatter_rows.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ScatterRowsOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(ScatterRowsOp);
VSPLAT_OPERATION(ScatterRowsOp, scatter_rows)

// Sums of float32 depend on their order, and here only the order by entry gives 1.
TEST_P(ScatterRowsOp, EntriesOfARowAreSummedInTheirOrder) {
  const std::vector<float> d = {1e8f, -1e8f, 1.0f};
  const ScatterPlan plan = make_scatter_plan(ctx(), ctx().upload({3}, std::vector<int>{2, 2, 2}, Type::i32),
                                             ctx().upload({3}, std::vector<float>{1, 1, 1}), 4);
  const Tensor out = ctx().upload({4, 1}, std::vector<float>{5, 6, 0, 8});
  scatter_rows(ctx(), {&plan, ctx().upload({3, 1}, d), 0, 1, 1, out});
  EXPECT_EQ(ctx().read<float>(out), (std::vector<float>{5, 6, 1, 8}));
}

TEST_P(ScatterRowsOp, NoRows) {
  const ScatterPlan plan = make_scatter_plan(ctx(), ctx().upload({2}, std::vector<int>{-1, -1}, Type::i32),
                                             ctx().upload({2}, std::vector<float>{1, 2}), 0);
  EXPECT_EQ(ctx().read<std::uint32_t>(plan.starts), std::vector<std::uint32_t>{0});
  scatter_rows(ctx(), {&plan, ctx().tensor({2, 3}), 0, 1, 1, ctx().tensor({0, 3})});
}

TEST_P(ScatterRowsOp, RejectsBadShape) {
  const Tensor index = ctx().upload({2, 4}, std::vector<int>(8, 1), Type::i32);
  const Tensor weight = ctx().upload({2, 4}, std::vector<float>(8, 1.0f));
  EXPECT_THROW(make_scatter_plan(ctx(), index, weight.reshaped({8}), 3), Error);
  EXPECT_THROW(make_scatter_plan(ctx(), weight, weight, 3), Error);
  const ScatterPlan plan = make_scatter_plan(ctx(), index, weight, 3);
  const Tensor d = ctx().tensor({2, 5}), out = ctx().tensor({3, 5});
  EXPECT_THROW(scatter_rows(ctx(), {nullptr, d, 0, 4, 1, out}), Error);
  EXPECT_THROW(scatter_rows(ctx(), {&plan, d, 0, 3, 1, out}), Error);
  EXPECT_THROW(scatter_rows(ctx(), {&plan, d, 1, 4, 1, out}), Error);
  EXPECT_THROW(scatter_rows(ctx(), {&plan, d, 0, 0, 1, out}), Error);
  EXPECT_THROW(scatter_rows(ctx(), {&plan, d, 0, 4, 1, ctx().tensor({4, 5})}), Error);
  EXPECT_THROW(scatter_rows(ctx(), {&plan, d, 0, 4, 1, ctx().tensor({3, 4})}), Error);
}

}  // namespace
}  // namespace vsplat

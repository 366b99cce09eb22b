#include "model/ops/dense/scatter_rows.h"

#include "model/diagnose/selftest/reference/scatter_rows.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ScatterRowsOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(ScatterRowsOp);
VSPLAT_OPERATION(ScatterRowsOp, scatter_rows)

// Windows of 64 sorted entries: runs that begin or end with one, span several, and are empty between.
TEST_P(ScatterRowsOp, RunsAgainstWindows) {
  for (const long channels : {1L, 4L, 19L}) {
    std::vector<int> index;
    int row = 0;
    for (const int length : {64, 64, 0, 1, 63, 128, 0, 65, 1, 126, 200, 3, 256, 1}) {
      index.insert(index.end(), static_cast<std::size_t>(length), row++);
    }
    const auto c = static_cast<std::size_t>(channels), rows = static_cast<std::size_t>(row);
    const long entries = static_cast<long>(index.size());
    const auto weight = test::random_floats(index.size(), 6, 0.5f, 2.0f), d = test::random_floats(index.size() * c, 7);
    std::vector<double> want(rows * c, 0);
    ref::scatter_rows(index, weight, d, c, 0, 1, 1, want);
    const ScatterPlan plan =
        make_scatter_plan(ctx(), ctx().upload({entries}, index, Type::i32), ctx().upload({entries}, weight), row);
    const Tensor out = ctx().upload({row, channels}, std::vector<float>(rows * c, 0.0f));
    scatter_rows(ctx(), {&plan, ctx().upload({entries, channels}, d), 0, 1, 1, out});
    EXPECT_TRUE(test::close(ctx().read<float>(out), want, 1e-6)) << channels;
  }
}

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

#include "model/ops/dense/scatter_rows.h"

#include "model/diagnose/selftest/reference/scatter_rows.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

struct ScatterRowsCase {
  long entries, rows, channels, per_row;
  long first = 0;
  float scale = 1;
  float low = -1;  // the least number of d, the largest being 1
};

class ScatterRowsOp : public test::FlavourTest {
 protected:
  // Indices from -1 on, so that some entries are passed over; every fifth weight is 0. A weight of 0 keeps whatever its
  // entry's row of d holds from the result, so those that nothing else reads are NaN.
  void check(const ScatterRowsCase& k) {
    const auto entries = static_cast<std::size_t>(k.entries), channels = static_cast<std::size_t>(k.channels);
    const auto per_row = static_cast<std::size_t>(k.per_row), first = static_cast<std::size_t>(k.first);
    std::vector<int> index(entries);
    std::mt19937 engine(5);
    for (int& i : index) i = static_cast<int>(engine() % static_cast<unsigned>(k.rows + 1)) - 1;
    std::vector<float> weight = test::random_floats(entries, 6, -1.0f, 2.0f);
    for (std::size_t e = 0; e < entries; e += 5) weight[e] = 0;
    const std::size_t used = first + (entries + per_row - 1) / per_row;
    std::vector<float> d = test::random_floats((used + 2) * channels, 7, k.low);
    const std::vector<float> before = test::random_floats(static_cast<std::size_t>(k.rows) * channels, 8);
    std::vector<double> want(before.begin(), before.end());
    ref::scatter_rows(index, weight, d, channels, first, per_row, static_cast<double>(k.scale), want);
    if (per_row == 1)
      for (std::size_t e = 0; e < entries; ++e)
        if (index[e] < 0 || weight[e] == 0) d[(first + e) * channels] = std::numeric_limits<float>::quiet_NaN();

    const ScatterPlan plan = make_scatter_plan(ctx(), ctx().upload({k.entries}, index, Type::i32),
                                               ctx().upload({k.entries}, weight), k.rows);
    const Tensor rows = ctx().upload({static_cast<long>(used) + 2, k.channels}, d);
    const auto run = [&] {
      const Tensor out = ctx().upload({k.rows, k.channels}, before);
      scatter_rows(ctx(), {&plan, rows, k.first, k.per_row, k.scale, out});
      return ctx().read<float>(out);
    };
    const std::vector<float> got = run();
    EXPECT_TRUE(test::close(got, want, 1e-6, k.rows == 0))
        << k.entries << " entries to " << k.rows << " rows of " << k.channels;
    EXPECT_EQ(run(), got) << "the plan serves again, with the same bits";
  }
};
VSPLAT_FLAVOURS(ScatterRowsOp);

TEST_P(ScatterRowsOp, MatchesReferenceAtEverySizeThatBreaksThings) {
  for (const long channels : {1L, 3L, 4L, 5L, 15L, 16L, 17L, 33L, 129L}) check({101, 7, channels, 1});
  for (const long entries : {0L, 1L, 3L, 7L, 63L, 64L, 65L, 1023L, 1024L, 1025L}) check({entries, 5, 6, 1});
  for (const long rows : {1L, 2L, 3L, 255L, 256L, 257L, 5000L}) check({997, rows, 3, 1});
}

TEST_P(ScatterRowsOp, SeveralEntriesTakeOneRow) {
  for (const long per_row : {2L, 4L, 12L, 16L, 60L}) check({240, 11, 18, per_row});
  check({97, 11, 18, 4, 13, 0.25f});
}

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

// Every entry falls on one of two rows: a plain sum of so many terms would be off by more.
TEST_P(ScatterRowsOp, LongRunsLoseNothing) { check({100000, 2, 1, 4, 0, 1, 0.0f}); }

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

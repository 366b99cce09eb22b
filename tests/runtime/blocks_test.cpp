#include "runtime/blocks.h"

#include <algorithm>

#include "tests/support/device.h"

namespace vsplat {
namespace {

class BlockStartsTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(BlockStartsTest);

using Starts = std::vector<long>;

TEST_P(BlockStartsTest, AreAllOfThemWhereSomethingIsDone) {
  EXPECT_EQ(block_starts(ctx(), 0, 8), Starts{});
  EXPECT_EQ(block_starts(ctx(), 1, 8), Starts{0});
  EXPECT_EQ(block_starts(ctx(), 8, 8), Starts{0});
  EXPECT_EQ(block_starts(ctx(), 9, 8), (Starts{0, 8}));
  EXPECT_EQ(block_starts(ctx(), 48, 8), (Starts{0, 8, 16, 24, 32, 40}));
}

TEST_P(BlockStartsTest, AreTheFirstAndTheLastOfAPlan) {
  const auto planner = ctx().planner();
  EXPECT_EQ(block_starts(*planner, 0, 8), Starts{});
  EXPECT_EQ(block_starts(*planner, 17, 8), (Starts{0, 8, 16}));
  EXPECT_EQ(block_starts(*planner, 25, 8), (Starts{0, 8, 16, 24}));
  EXPECT_EQ(block_starts(*planner, 49, 8), (Starts{0, 8, 16, 48}));
}

// Pieces of several sizes are allocated and freed in different orders, block after block.
TEST_P(BlockStartsTest, TakeAsMuchInAPlanAsThoseLeftOut) {
  const auto use = [](Context& c, const Starts& starts, long count, long block) {
    const Tensor held = c.tensor({1000});
    for (const long first : starts) {
      const long n = std::min(block, count - first);
      Tensor a = c.tensor({n, 7});
      const Tensor b = c.tensor({n, 64});
      a = {};
      const Tensor d = c.tensor({n, 5}), e = c.tensor({n, 3});
    }
    return c.memory().peak();
  };
  for (const long count : {1L, 64L, 65L, 640L, 1001L}) {
    const auto some = ctx().planner(), all = ctx().planner();
    Starts every;
    for (long first = 0; first < count; first += 64) every.push_back(first);
    EXPECT_EQ(use(*some, block_starts(*some, count, 64), count, 64), use(*all, every, count, 64)) << count;
  }
}

}  // namespace
}  // namespace vsplat

#include "model/render/reserve.h"

#include <gtest/gtest.h>

#include "tests/support/device.h"

namespace vsplat {
namespace {

// Counts the plans of work that takes `bytes`.
struct Counted {
  long bytes = 1 << 20, plans = 0;
  void operator()(Context& c) {
    if (c.planning()) ++plans;
    c.tensor({bytes}, Type::u8, "work");
  }
};

TEST(RepeatedWork, IsPlannedAgainOnlyWhereItGrows) {
  const auto ctx = test::open_context(Flavour::cpu);
  RepeatedWork repeated;
  Counted work;
  const auto reserve = [&](std::array<std::uint64_t, 4> sizes) {
    return repeated.reserve(*ctx, sizes, std::ref(work));
  };
  EXPECT_TRUE(reserve({5, 5, 5, 5}));
  EXPECT_GE(ctx->memory().reserved(), 1u << 20);
  const long once = work.plans;
  EXPECT_GT(once, 0);
  for (const auto& sizes : {std::array<std::uint64_t, 4>{5, 5, 5, 5}, {1, 2, 3, 4}, {0, 0, 0, 0}})
    EXPECT_TRUE(reserve(sizes));
  EXPECT_EQ(work.plans, once);
  for (std::size_t i = 0; i < 4; ++i) {
    std::array<std::uint64_t, 4> more{5, 5, 5, 5};
    more[i] = 6;
    const long before = work.plans;
    EXPECT_TRUE(reserve(more));
    EXPECT_GT(work.plans, before) << i;
  }
  const long before = work.plans;
  EXPECT_TRUE(reserve({6, 6, 6, 6}));
  EXPECT_EQ(work.plans, before);
  ctx->memory().trim();  // what was reserved is gone
  EXPECT_TRUE(reserve({1, 1, 1, 1}));
  EXPECT_GT(work.plans, before);
}

TEST(RepeatedWork, IsAlwaysPlannedWhereMemoryIsScarce) {
  ContextOptions few;
  few.max_memory_gib = 0.01;
  const auto ctx = test::open_context(Flavour::cpu, few);
  RepeatedWork repeated;
  Counted work{7 << 20};
  EXPECT_TRUE(repeated.reserve(*ctx, {1, 1, 1, 1}, std::ref(work)));
  const long before = work.plans;
  EXPECT_TRUE(repeated.reserve(*ctx, {1, 1, 1, 1}, std::ref(work)));
  EXPECT_GT(work.plans, before);
  work.bytes = 20 << 20;
  EXPECT_FALSE(repeated.reserve(*ctx, {1, 1, 1, 1}, std::ref(work)));
}

}  // namespace
}  // namespace vsplat

#include "model/ops/volume/top_k.h"

#include "model/diagnose/selftest/reference/top_k.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class TopKTest : public test::FlavourTest {
 protected:
  void check(const std::vector<float>& x, long k) {
    SCOPED_TRACE(std::to_string(k) + " of " + std::to_string(x.size()));
    const auto n = static_cast<long>(x.size());
    const std::vector<std::uint32_t> gaps(x.size(), 7);
    const Tensor flags = ctx().upload({n}, gaps, Type::u32), others = ctx().upload({n}, gaps, Type::u32);
    top_k(ctx(), {ctx().upload({n}, x), k, flags, others});
    const auto want = ref::top_k(x, static_cast<std::size_t>(k));
    EXPECT_EQ(ctx().read<std::uint32_t>(flags), want);
    auto rest = ctx().read<std::uint32_t>(others);
    for (std::uint32_t& flag : rest) flag = 1 - flag;
    EXPECT_EQ(rest, want);
  }
};
VSPLAT_FLAVOURS(TopKTest);
VSPLAT_OPERATION(TopKTest, top_k)

// Among equal numbers the first ones are chosen; infinities and numbers of either sign are ordered correctly.
TEST_P(TopKTest, EqualNumbersInTheirOrder) {
  std::vector<float> x(500);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = static_cast<float>(i * 7 % 5) - 2;
  for (const long k : {1L, 99L, 100L, 101L, 250L, 499L}) check(x, k);
  const float huge = std::numeric_limits<float>::infinity();
  for (const long k : {1L, 2L, 3L, 4L, 5L, 6L}) check({-huge, -3, -0.0f, 0, 1e-30f, 2, huge, -1e30f}, k);
}

TEST_P(TopKTest, RejectsBadShape) {
  const Tensor x = ctx().tensor({4}), flags = ctx().tensor({4}, Type::u32);
  EXPECT_THROW(top_k(ctx(), {x, 2, ctx().tensor({5}, Type::u32), {}}), Error);
  EXPECT_THROW(top_k(ctx(), {x, -1, flags, {}}), Error);
  EXPECT_THROW(top_k(ctx(), {x, 2, flags, x}), Error);
}

}  // namespace
}  // namespace vsplat

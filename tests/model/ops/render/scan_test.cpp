#include "model/ops/render/scan.h"

#include <gtest/gtest.h>

#include "model/base/rng.h"
#include "model/diagnose/selftest/reference/scan.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ScanOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(ScanOp);
VSPLAT_OPERATION(ScanOp, scan)

std::vector<std::uint32_t> random_counts(long n, std::uint32_t bound) {
  std::vector<std::uint32_t> v(static_cast<std::size_t>(n));
  for (std::size_t i = 0; i < v.size(); ++i) {
    v[i] = philox4x32_10({static_cast<std::uint32_t>(i), 0, 0, 0}, rng_key(17))[0] % bound;
  }
  return v;
}

void check_scan(Context& ctx, long n, std::uint32_t bound) {
  const std::vector<std::uint32_t> in = random_counts(n, bound);
  const Tensor x = ctx.upload({n}, in, Type::u32);
  const Tensor y =
      ctx.upload({n + 1}, std::vector<std::uint32_t>(static_cast<std::size_t>(n) + 1, 0xDEADBEEFu), Type::u32);
  exclusive_scan(ctx, x, y);
  EXPECT_EQ(ctx.read<std::uint32_t>(y), ref::exclusive_scan(in)) << n << " elements";
}

TEST(Scan, MatchesReferenceAtEverySizeThatBreaksThings) {
  Context& ctx = test::context(Flavour::cpu);
  // A block is 64 * 32 = 2048 elements; the second and third level begin at 2049 and 2048^2 + 1.
  for (const long n : {1L, 3L, 7L, 31L, 32L, 33L, 101L, 2047L, 2048L, 2049L, 4096L, 65537L}) check_scan(ctx, n, 1000);
}

TEST(Scan, ThreeLevels) { check_scan(test::context(Flavour::cpu), 2048L * 2048 + 5, 2); }

TEST(Scan, WrapsAroundModulo2To32) { check_scan(test::context(Flavour::cpu), 5000, 0xFFFFFFFFu); }

TEST(Scan, EmptyInputHasTotalZero) {
  Context& ctx = test::context(Flavour::cpu);
  const Tensor y = ctx.upload({1}, std::vector<std::uint32_t>{5}, Type::u32);
  exclusive_scan(ctx, ctx.tensor({0}, Type::u32), y);
  EXPECT_EQ(ctx.read<std::uint32_t>(y), std::vector<std::uint32_t>{0});
}

TEST(Scan, RejectsBadShape) {
  Context& ctx = test::context(Flavour::cpu);
  EXPECT_THROW(exclusive_scan(ctx, ctx.tensor({4}, Type::u32), ctx.tensor({4}, Type::u32)), Error);
  EXPECT_THROW(exclusive_scan(ctx, ctx.tensor({4}), ctx.tensor({5}, Type::u32)), Error);
}

}  // namespace
}  // namespace vsplat

// Products of pairs in the cpu flavour: emulated, and by the processor's instructions where it has them. Both are exact
// for small integers, and within the error of rounded operands and float sums for other numbers.
#include "runtime/gemm_pairs.h"

#include <gtest/gtest.h>

#include "model/diagnose/selftest/cases/cases.h"
#include "runtime/tuning/matrix_probe.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/rounded_products.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

using test::random_floats;

std::size_t numbers(long a, long b) { return static_cast<std::size_t>(a * b); }

bool has_instructions() {
  const auto units = test::context(Flavour::cpu).device().matrix_units;
  return std::count(units.begin(), units.end(), MatrixUnit::avx512bf16) > 0;
}

std::unique_ptr<Context> open(MatrixUnit unit) {
  ContextOptions options;
  options.precision = Precision::mixed, options.matrix_unit = unit;
  return test::open_context(Flavour::cpu, options);
}

// [m, k] times [n, k], transposed.
std::vector<float> product(Context& ctx, long m, long n, long k, const std::vector<float>& a,
                           const std::vector<float>& w) {
  const PackedMatrix b = pack_pairs(ctx, w.data(), k, n, 1, k, "weight");
  Gemm g;
  g.a.x0 = ctx.upload({m, k}, a), g.b = &b;
  g.out = ctx.upload({m, n}, test::nans(numbers(m, n)));
  gemm(ctx, g);
  return ctx.read<float>(g.out);
}

class GemmPairs : public ::testing::TestWithParam<MatrixUnit> {
 protected:
  void SetUp() override {
    if (test::context(Flavour::cpu).device().native_float_width < 4) GTEST_SKIP() << "no vectors";
    if (GetParam() != MatrixUnit::emulated && !has_instructions()) GTEST_SKIP() << "no such instructions";
    ctx_ = open(GetParam());
  }
  test::Product product_here() {
    return [this](long m, long n, long k, const auto& a, const auto& w) { return product(*ctx_, m, n, k, a, w); };
  }
  std::unique_ptr<Context> ctx_;
};

// Every product, of sizes about a tile: the cases of the self-test.
TEST_P(GemmPairs, AreRightInEveryCase) {
  for (const char* stem : {"gemm", "conv3d", "attention"})
    for (const selftest::Case& one : selftest::cases_of(stem)) {
      if (std::string(one.name).find("_pairs") == std::string::npos) continue;
      selftest::Checks checks(*ctx_, selftest::Sizes::all);
      checks.run(one.name, one.run);
      EXPECT_FALSE(checks.findings().empty()) << one.name;
      for (const selftest::Finding& f : checks.findings())
        EXPECT_TRUE(f.right) << f.what << ": off by " << f.error << ", " << f.tolerance << " allowed " << f.trouble;
    }
}

TEST_P(GemmPairs, AreWithinTheBound) {
  test::expect_within_the_bound(8, {{1, 1, 1}, {3, 7, 1009}, {11, 31, 15}, {13, 33, 17}, {25, 65, 513}},
                                product_here());
}

TEST_P(GemmPairs, RoundOperandsToNearestEven) { test::expect_rounding_to_nearest_even(8, product_here()); }

TEST_P(GemmPairs, GiveTheSameBitsEachTime) {
  const auto a = random_floats(numbers(70, 301), 1), w = random_floats(numbers(97, 301), 2);
  const auto first = product(*ctx_, 70, 97, 301, a, w);
  EXPECT_EQ(product(*ctx_, 70, 97, 301, a, w), first);
  EXPECT_EQ(product(*open(GetParam()), 70, 97, 301, a, w), first);
}

TEST_P(GemmPairs, TheDevicePacksAsTheHostDoes) {
  const test::Variable every("VSPLAT_MATRIX_LEAST", "1");
  for (const long k : {1L, 3L, 64L, 129L})
    for (const long n : {1L, 7L, 31L, 32L, 33L}) {
      const auto w = random_floats(numbers(k, n), 1);
      const Tensor on_device = ctx_->upload({k, n}, w);
      for (const auto& [k_stride, n_stride] : {std::pair<long, long>{1, k}, {n, 1}}) {
        const PackedMatrix want = pack_matrix(*ctx_, w.data(), k, n, k_stride, n_stride, "w");
        const PackedMatrix got = pack_matrix(*ctx_, on_device, k, n, k_stride, n_stride, "w");
        EXPECT_TRUE(want.pairs && got.pairs);
        EXPECT_EQ(ctx_->read<std::uint32_t>(got.data), ctx_->read<std::uint32_t>(want.data)) << k << " x " << n;
      }
    }
}

TEST_P(GemmPairs, TakeLargeMatricesThatNeedNotBeExact) {
  const auto w = random_floats(numbers(64, 64), 1);
  EXPECT_TRUE(pack_matrix(*ctx_, w.data(), 64, 64, 1, 64, "w").pairs);
  EXPECT_FALSE(pack_matrix(*ctx_, w.data(), 64, 64, 1, 64, "w", true).pairs);
  EXPECT_FALSE(pack_matrix(*ctx_, w.data(), 64, 31, 1, 64, "w").pairs);
  EXPECT_FALSE(pack_matrix(*ctx_, w.data(), 31, 64, 1, 31, "w").pairs);
  EXPECT_FALSE(pack_matrix(test::context(Flavour::cpu), w.data(), 64, 64, 1, 64, "w").pairs);
  const PackedMatrix b = pack_matrix(*ctx_, w.data(), 64, 64, 1, 64, "w");
  EXPECT_EQ(b.data.bytes(), std::size_t{64 * 64 * 2});
  Gemm g;
  g.a.x0 = ctx_->upload({64, 64}, w), g.b = &b, g.out = ctx_->tensor({64, 64}), g.exact = true;
  EXPECT_THROW(gemm(*ctx_, g), Error);
}

INSTANTIATE_TEST_SUITE_P(Units, GemmPairs, ::testing::Values(MatrixUnit::emulated, MatrixUnit::avx512bf16),
                         [](const auto& instance) { return std::string(name_of(instance.param)); });

// The instruction takes operands below 2^-126 as zeros, and flushes such sums: for each of k terms, at most 2^-126
// times the other operand, and 2^-126. Other numbers give the bits of the emulation.
TEST(GemmPairsUnits, DifferByDenormalsAlone) {
  if (!has_instructions()) GTEST_SKIP() << "no such instructions";
  const auto emulated = open(MatrixUnit::emulated), real = open(MatrixUnit::avx512bf16);
  const long m = 25, n = 65, k = 1031;
  const auto a = random_floats(numbers(m, k), 1, -3, 3), w = random_floats(numbers(n, k), 2, -3, 3);
  EXPECT_EQ(product(*real, m, n, k, a, w), product(*emulated, m, n, k, a, w));
  std::vector<float> small = a;
  for (float& v : small) v *= 0x1p-127f;
  const auto got = product(*real, m, n, k, small, w), want = product(*emulated, m, n, k, small, w);
  const double bound = static_cast<double>(k) * 0x1p-126 * (3 + 1);
  for (std::size_t i = 0; i < got.size(); ++i)
    EXPECT_LE(std::abs(static_cast<double>(got[i]) - static_cast<double>(want[i])), bound);
  // One denormal operand vanishes; one of 2^-126 stays.
  EXPECT_EQ(product(*real, 1, 1, 1, {0x1p-127f}, {0x1p100f})[0], 0.0f);
  EXPECT_EQ(product(*real, 1, 1, 1, {0x1p-126f}, {0x1p100f})[0], 0x1p-26f);
  EXPECT_EQ(product(*real, 1, 1, 1, {0x1p-100f}, {0x1p-27f})[0], 0.0f);
}

}  // namespace
}  // namespace vsplat

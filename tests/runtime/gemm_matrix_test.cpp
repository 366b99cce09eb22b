// Matrix products on emulated fragments: exact for small integers, and for other numbers within the error of rounded
// operands and float sums.
#include "runtime/gemm_matrix.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/diagnose/selftest/inputs/products.h"
#include "runtime/tuning/held_tuning.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/rounded_products.h"

namespace vsplat {
namespace {

using test::random_floats;

std::size_t numbers(long a, long b) { return static_cast<std::size_t>(a * b); }

int bits_of(Operands operands) { return operands == Operands::bf16 ? 8 : 11; }

class GemmMatrixTest : public ::testing::TestWithParam<Operands> {
 protected:
  static Context& ctx() { return test::context(Flavour::gpu); }

  static MatrixProducts upload(long m, long n, long k, const std::vector<float>& a, const std::vector<float>& w) {
    MatrixProducts p;
    p.a.x0 = ctx().upload({m, k}, a), p.src_rows = p.m = m, p.n = n;
    p.b = pack_matrix(ctx(), w.data(), k, n, 1, k, "weight").data;
    p.out = ctx().upload({m, n}, test::nans(numbers(m, n)));
    p.operands = GetParam();
    return p;
  }

  static std::vector<float> product(long m, long n, long k, const std::vector<float>& a, const std::vector<float>& w) {
    const MatrixProducts p = upload(m, n, k, a, w);
    gemm_matrix(ctx(), p);
    return ctx().read<float>(p.out);
  }
};

TEST_P(GemmMatrixTest, IsWithinTheBound) {
  test::expect_within_the_bound(
      bits_of(GetParam()),
      {{1, 1, 1}, {3, 7, 1009}, {16, 8, 16}, {17, 9, 15}, {64, 64, 32}, {65, 63, 33}, {129, 31, 257}}, product);
}

TEST_P(GemmMatrixTest, RoundsOperandsToNearestEven) {
  test::expect_rounding_to_nearest_even(bits_of(GetParam()), product);
}

// Some of the rows are written to their place, and nothing else is; two runs give the same bits.
TEST_P(GemmMatrixTest, WritesItsRowsAlone) {
  const auto a = random_floats(numbers(70, 40), 1), w = random_floats(numbers(33, 40), 2);
  MatrixProducts p = upload(70, 33, 40, a, w);
  gemm_matrix(ctx(), p);
  const auto all = ctx().read<float>(p.out);
  const auto before = random_floats(numbers(90, 33), 3);
  p.out = ctx().upload({90, 33}, before);
  p.row0 = 20, p.m = 35, p.out_row0 = 41;
  gemm_matrix(ctx(), p);
  const auto got = ctx().read<float>(p.out);
  for (std::size_t i = 0; i < got.size(); ++i)
    EXPECT_EQ(got[i], i / 33 >= 41 && i / 33 < 76 ? all[i - std::size_t{21} * 33] : before[i]) << i;
}

// Products side by side, with rows in lines of five plus two, as in Winograd's method.
TEST_P(GemmMatrixTest, MultipliesSideBySide) {
  for (const auto& [c, n] : {std::array<long, 2>{18, 21}, {20, 24}}) {
    const long products = 3, lines = 7, line = 5;
    // Integers, which operands represent exactly.
    auto x = random_floats(numbers(products * lines * (line + 2), c), 1, -15, 15),
         w = random_floats(numbers(products * 3 * c, n), 2, -15, 15);
    for (float& v : x) v = std::trunc(v);
    for (float& v : w) v = std::trunc(v);
    MatrixProducts p;
    p.a.x0 = ctx().upload({products, lines * (line + 2), c}, x), p.line = line, p.src_rows = lines * (line + 2);
    p.b = ctx().upload({products, 3 * c, n}, w), p.products = products, p.m = lines * line, p.n = n;
    p.out = ctx().upload({products, p.m, n}, test::nans(numbers(products * p.m, n)));
    p.operands = GetParam();
    gemm_matrix(ctx(), p);
    const auto got = ctx().read<float>(p.out);
    for (long s = 0; s < products; ++s)
      for (long m = 0; m < p.m; ++m)
        for (long j = 0; j < n; ++j) {
          double sum = 0;
          for (long t = 0; t < 3; ++t)
            for (long k = 0; k < c; ++k)
              sum += static_cast<double>(
                         x[numbers((s * lines + m / line) * (line + 2) + m % line + t, c) + numbers(k, 1)]) *
                     static_cast<double>(w[numbers((s * 3 + t) * c + k, n) + numbers(j, 1)]);
          ASSERT_EQ(got[numbers(s * p.m + m, n) + numbers(j, 1)], static_cast<float>(sum)) << s << " " << m << " " << j;
        }
  }
}

TEST_P(GemmMatrixTest, RefusesWhatDoesNotFit) {
  const MatrixProducts p = upload(5, 6, 7, random_floats(35, 1), random_floats(42, 2));
  const auto rejects = [&](auto change) {
    MatrixProducts q = p;
    change(q);
    EXPECT_THROW(gemm_matrix(ctx(), q), Error);
  };
  rejects([](MatrixProducts& q) { q.b = ctx().tensor({7, 5}); });
  rejects([](MatrixProducts& q) { q.products = 2, q.residual = q.out; });
  rejects([](MatrixProducts& q) { q.line = 2, q.a.map = ctx().tensor({5, 1}, Type::i32); });
}

INSTANTIATE_TEST_SUITE_P(Operands, GemmMatrixTest, ::testing::Values(Operands::bf16, Operands::tf32),
                         [](const auto& instance) { return instance.param == Operands::bf16 ? "bf16" : "tf32"; });

// gemm() and convolutions in a context of mixed precision and the gpu kernels round operands if it pays off and exact
// results are not requested.
class MixedContextTest : public ::testing::Test {
 protected:
  static std::unique_ptr<Context> open() {
    ContextOptions options;
    options.precision = Precision::mixed, options.matrix_unit = MatrixUnit::emulated;
    return std::make_unique<Context>(options);
  }
};

TEST_F(MixedContextTest, RoundsLargeProductsAlone) {
  const auto ctx = open();
  EXPECT_EQ(ctx->flavour(), Flavour::gpu);
  const auto error = [&](long m, long n, long k, bool exact) {
    const ref::GemmCase c = selftest::gemm_case({m, n, k});
    const auto d = selftest::upload_product(*ctx, c);
    d->g.exact = exact;
    gemm(*ctx, d->g);
    const auto got = ctx->read<float>(d->g.out);
    const auto want = c.all();
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < got.size(); ++i)
      worst = std::max(worst, std::abs(got[i] - want[i])), largest = std::max(largest, std::abs(want[i]));
    return worst / largest;
  };
  EXPECT_GT(error(64, 64, 64, false), 1e-4);
  EXPECT_LT(error(64, 64, 64, false), 8e-3);
  EXPECT_LT(error(64, 64, 64, true), 1e-5);
  EXPECT_LT(error(64, 5, 64, false), 1e-5);
  EXPECT_LT(error(64, 64, 9, false), 1e-5);
}

TEST_F(MixedContextTest, StreamsAndPlannersHaveIt) {
  const auto ctx = open();
  for (const auto& other : {ctx->stream(), ctx->planner()}) {
    EXPECT_EQ(other->precision(), Precision::mixed);
    EXPECT_EQ(other->matrix_unit(), MatrixUnit::emulated);
  }
}

TEST_F(MixedContextTest, HeldStateGoesOnInItsPrecisionAlone) {
  const auto mixed = open();
  Context& exact = test::context(Flavour::gpu);
  std::map<std::string, std::string> of_mixed, of_exact;
  hold_tuning(*mixed, of_mixed);
  hold_tuning(exact, of_exact);
  EXPECT_EQ(of_mixed.at("precision"), "mixed");
  EXPECT_NO_THROW(refuse_other_tuning(*mixed, of_mixed, "state"));
  EXPECT_THROW(refuse_other_tuning(exact, of_mixed, "state"), Error);
  EXPECT_THROW(refuse_other_tuning(*mixed, of_exact, "state"), Error);
}

TEST_F(MixedContextTest, RefusesWhatMultipliesInFp32) {
  ContextOptions options;
  options.precision = Precision::mixed, options.matrix_unit = MatrixUnit::emulated;
  options.gemm = GemmChoice::clblast;
  EXPECT_THROW(Context{options}, Error);
}

}  // namespace
}  // namespace vsplat

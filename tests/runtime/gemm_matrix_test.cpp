// Matrix products on emulated fragments: exact for small integers, and for other numbers within the error of rounded
// operands and float sums.
#include "runtime/gemm_matrix.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "model/diagnose/selftest/reference/activation.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/ops/dense/conv3d.h"
#include "runtime/tuning/held_tuning.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::random_floats;

std::size_t numbers(long a, long b) { return static_cast<std::size_t>(a * b); }

// Rounds to nearest, ties to even, by the definition: one of the two neighbours with `bits` of significand.
double rounded(double x, int bits) {
  if (x == 0 || !std::isfinite(x)) return x;
  int exponent = 0;
  std::frexp(x, &exponent);
  const double step = std::ldexp(1.0, std::max(exponent, -125) - bits);
  return std::nearbyint(x / step) * step;  // (ties to even is the default)
}

int bits_of(Operands operands) { return operands == Operands::bf16 ? 8 : 11; }

class GemmMatrixTest : public ::testing::TestWithParam<Operands> {
 protected:
  static Context& ctx() { return test::context(Flavour::gpu); }

  static MatrixProducts upload(const ref::GemmCase& c) {
    MatrixProducts p;
    p.a = selftest::upload_rows(ctx(), c.a);
    if (!c.map.empty()) p.a.map = ctx().upload({c.m, c.taps}, c.map, Type::i32);
    p.src_rows = c.a.rows, p.m = c.m, p.n = c.n;
    p.b = pack_matrix(ctx(), c.w.data(), c.k, c.n, 1, c.k, "weight").data;
    if (!c.bias.empty()) p.bias = ctx().upload({c.n}, c.bias);
    if (!c.residual.empty()) p.residual = ctx().upload({c.m, c.n}, c.residual);
    p.activation = static_cast<Activation>(c.act);
    p.out = ctx().upload({c.m, c.n}, test::nans(numbers(c.m, c.n)));
    p.operands = GetParam();
    return p;
  }

  static std::vector<float> product(const ref::GemmCase& c) {
    const MatrixProducts p = upload(c);
    gemm_matrix(ctx(), p);
    return ctx().read<float>(p.out);
  }
};

ref::GemmCase plain(long m, long n, long k, const std::vector<float>& a, const std::vector<float>& w) {
  ref::GemmCase c;
  c.m = c.a.rows = m, c.n = n, c.k = c.a.c0 = k, c.a.x0 = a, c.w = w;
  return c;
}

// Integers up to 15, which operands represent exactly; sums below 2^24 are exact in any order.
std::vector<float> integers(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::vector<float> out;
  for (std::size_t i = 0; i < count; ++i) out.push_back(static_cast<float>(static_cast<int>(engine() % 31) - 15));
  return out;
}

constexpr long kSizes[] = {1, 3, 7, 8, 15, 16, 17, 31, 32, 33, 63, 64, 65, 101, 127, 128, 129};

TEST_P(GemmMatrixTest, OfIntegersIsExact) {
  const auto holds = [&](long m, long n, long k) {
    const auto a = integers(numbers(m, k), 1), w = integers(numbers(n, k), 2);
    const auto got = product(plain(m, n, k, a, w));
    for (long i = 0; i < m; ++i)
      for (long j = 0; j < n; ++j) {
        long sum = 0;
        for (long t = 0; t < k; ++t)
          sum += std::lround(a[numbers(i, k) + numbers(t, 1)]) * std::lround(w[numbers(j, k) + numbers(t, 1)]);
        ASSERT_EQ(got[numbers(i, n) + numbers(j, 1)], static_cast<float>(sum))
            << m << " x " << n << " x " << k << " at " << i << ", " << j;
      }
  };
  for (const long size : kSizes) {
    holds(size, 5, 3), holds(3, size, 5), holds(5, 3, size);
    holds(size, size, size);
  }
  holds(65, 33, 1009);
  holds(128L * 2 * ctx().device().compute_units + 1, 134, 37);  // enough tiles for the large ones
}

// |sum of rounded products - sum of products| <= (2 u + u^2) times the sum of the products' magnitudes, u = 2^-bits.
// Summing K products in floats adds at most K 2^-23 of that, however a unit rounds within a step.
TEST_P(GemmMatrixTest, IsWithinTheBound) {
  for (const auto& [m, n, k] : {std::array<long, 3>{1, 1, 1},
                                {3, 7, 1009},
                                {16, 8, 16},
                                {17, 9, 15},
                                {64, 64, 32},
                                {65, 63, 33},
                                {129, 31, 257}}) {
    const auto a = random_floats(numbers(m, k), 3), w = random_floats(numbers(n, k), 4);
    const auto got = product(plain(m, n, k, a, w));
    const double u = std::ldexp(1.0, -bits_of(GetParam())), slack = static_cast<double>(k) * std::ldexp(1.0, -23);
    double error = 0;
    for (long i = 0; i < m; ++i)
      for (long j = 0; j < n; ++j) {
        double exact = 0, close = 0, sizes = 0;
        for (long t = 0; t < k; ++t) {
          const double x = a[numbers(i, k) + numbers(t, 1)], y = w[numbers(j, k) + numbers(t, 1)];
          const double rx = rounded(x, bits_of(GetParam())), ry = rounded(y, bits_of(GetParam()));
          exact += x * y, close += rx * ry, sizes += std::abs(rx * ry);
        }
        const double is = got[numbers(i, n) + numbers(j, 1)];
        EXPECT_LE(std::abs(is - close), slack * sizes) << m << " x " << n << " x " << k;
        EXPECT_LE(std::abs(is - exact), (2 * u + u * u + 2 * slack) * sizes) << m << " x " << n << " x " << k;
        error = std::max(error, std::abs(is - exact));
      }
    EXPECT_GT(error, 0) << "nothing was rounded";
  }
}

// One term, and one column of 1: the result is the operand.
TEST_P(GemmMatrixTest, RoundsOperandsToNearestEven) {
  const int bits = bits_of(GetParam()), dropped = 24 - bits;
  std::vector<float> x = {0.0f, -0.0f, 1.0f, -1.0f, 3.14159265f, -2.7182818f, 1e-30f, 65504.0f, INFINITY, -INFINITY};
  for (int i = 0; i < 64; ++i)  // ties, and their neighbours
    for (const int off : {-1, 0, 1}) {
      const std::uint32_t word =
          (127u << 23) + (static_cast<unsigned>(2 * i + 1) << (dropped - 1)) + static_cast<unsigned>(off);
      float value;
      std::memcpy(&value, &word, sizeof value);
      x.push_back(value), x.push_back(-value);
    }
  const auto more = random_floats(500, 5, -100, 100);
  x.insert(x.end(), more.begin(), more.end());
  const auto got = product(plain(static_cast<long>(x.size()), 1, 1, x, {1.0f}));
  for (std::size_t i = 0; i < x.size(); ++i)
    EXPECT_EQ(got[i], static_cast<float>(rounded(x[i], bits))) << fmt::format("{:a}", x[i]);
  const std::uint32_t least = 0x7f800001u;  // a NaN whose bits would all be dropped
  float nan;
  std::memcpy(&nan, &least, sizeof nan);
  EXPECT_TRUE(std::isnan(product(plain(1, 1, 1, {nan}, {1.0f}))[0]));
}

// Two sources, affine, SiLU, absent rows, bias, residual and activations: as in fp32, but with rounded operands. Rows
// with a multiple of four elements are loaded into local memory in another way.
TEST_P(GemmMatrixTest, ComposesAndFinishesAsGemmDoes) {
  const double tolerance = GetParam() == Operands::bf16 ? 8e-3 : 1e-3;
  for (const auto& [c0, c1, n] : {std::array<long, 3>{19, 0, 43}, {19, 5, 43}, {20, 0, 44}, {20, 16, 44}, {20, 5, 44}})
    for (const bool affine : {false, true})
      for (const long taps : {1L, 8L, 27L})
        for (const int act : {0, 1, 2, 3, 4}) {
          ref::GemmCase c;
          c.m = 37, c.n = n, c.taps = taps, c.act = act;
          c.a.rows = taps > 1 ? 41 : 37, c.a.c0 = c0, c.a.c1 = c1, c.a.silu = affine;
          c.k = taps * (c0 + c1);
          c.a.x0 = random_floats(numbers(c.a.rows, c0), 1), c.a.x1 = random_floats(numbers(c.a.rows, c1), 2);
          if (affine)
            c.a.scale = random_floats(numbers(c0 + c1, 1), 3, 0.5f, 2.0f),
            c.a.shift = random_floats(numbers(c0 + c1, 1), 4);
          std::mt19937 engine(5);
          for (long i = 0; taps > 1 && i < c.m * taps; ++i)
            c.map.push_back(static_cast<int>(engine() % static_cast<unsigned>(c.a.rows + 4)) - 2);
          c.w = random_floats(numbers(c.n, c.k), 6), c.bias = random_floats(numbers(c.n, 1), 7);
          if (act % 2 == 0) c.residual = random_floats(numbers(c.m, c.n), 8);
          EXPECT_TRUE(test::close(product(c), c.all(), tolerance))
              << c0 << " " << c1 << " " << affine << " " << taps << " " << act;
        }
}

// Some of the rows are written to their place, and nothing else is; two runs give the same bits.
TEST_P(GemmMatrixTest, WritesItsRowsAlone) {
  const auto a = random_floats(numbers(70, 40), 1), w = random_floats(numbers(33, 40), 2);
  MatrixProducts p = upload(plain(70, 33, 40, a, w));
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
    const auto x = integers(numbers(products * lines * (line + 2), c), 1),
               w = integers(numbers(products * 3 * c, n), 2);
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
  const MatrixProducts p = upload(plain(5, 6, 7, random_floats(35, 1), random_floats(42, 2)));
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
                         [](const auto& info) { return info.param == Operands::bf16 ? "bf16" : "tf32"; });

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
    const auto a = random_floats(numbers(m, k), 1), w = random_floats(numbers(n, k), 2);
    const ref::GemmCase c = plain(m, n, k, a, w);
    const PackedMatrix b = pack_matrix(*ctx, w.data(), k, n, 1, k, "weight");
    Gemm g;
    g.a.x0 = ctx->upload({m, k}, a), g.b = &b, g.out = ctx->tensor({m, n}), g.exact = exact;
    gemm(*ctx, g);
    const auto got = ctx->read<float>(g.out);
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

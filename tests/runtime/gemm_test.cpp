#include "runtime/gemm.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numeric>

#include "model/diagnose/selftest/reference/gemm.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::random_floats;

// A case: sizes, and the parts of the composition and the epilogue that are used.
struct Try {
  long m, n, k;  // k: of x0
  long c1 = 0;
  bool affine = false, silu = false;
  long taps = 0;  // > 0: gathered, with absent rows
  bool bias = true, residual = false;
  Activation act = Activation::none;
};

std::size_t count(long a, long b) { return static_cast<std::size_t>(a * b); }

ref::GemmCase make_case(const Try& t, std::uint32_t seed = 1) {
  ref::GemmCase c;
  c.m = t.m, c.n = t.n, c.taps = std::max(1L, t.taps), c.act = static_cast<int>(t.act);
  c.a.rows = t.taps ? t.m + 5 : t.m, c.a.c0 = t.k, c.a.c1 = t.c1, c.a.silu = t.silu;
  c.k = c.taps * (t.k + t.c1);
  c.a.x0 = random_floats(count(c.a.rows, t.k), seed);
  c.a.x1 = random_floats(count(c.a.rows, t.c1), seed + 1);
  if (t.affine) {
    c.a.scale = random_floats(count(t.k + t.c1, 1), seed + 2, 0.5f, 2.0f);
    c.a.shift = random_floats(count(t.k + t.c1, 1), seed + 3);
  }
  if (t.taps) {
    // A third of the rows is absent, marked in each of the ways that a map allows.
    std::mt19937 engine(seed + 4);
    for (long i = 0; i < t.m * t.taps; ++i) {
      const long row = static_cast<long>(engine() % static_cast<std::uint32_t>(c.a.rows));
      const auto kind = engine() % 6;
      c.map.push_back(static_cast<int>(kind == 0 ? -1 : kind == 1 ? c.a.rows + row : row));
    }
  }
  c.w = random_floats(count(c.n, c.k), seed + 5);
  if (t.bias) c.bias = random_floats(count(c.n, 1), seed + 6);
  if (t.residual) c.residual = random_floats(count(c.m, c.n), seed + 7);
  return c;
}

// The case on the device. Owns what its Gemm points to.
struct OnDevice {
  PackedMatrix b;
  Gemm g;
};

std::unique_ptr<OnDevice> upload(Context& ctx, const ref::GemmCase& c) {
  auto d = std::make_unique<OnDevice>();
  d->b = pack_matrix(ctx, c.w.data(), c.k, c.n, 1, c.k, "weight");
  d->g.b = &d->b;
  d->g.a.x0 = ctx.upload({c.a.rows, c.a.c0}, c.a.x0);
  if (c.a.c1) d->g.a.x1 = ctx.upload({c.a.rows, c.a.c1}, c.a.x1);
  if (!c.a.scale.empty()) {
    d->g.a.scale = ctx.upload({c.a.c0 + c.a.c1}, c.a.scale);
    d->g.a.shift = ctx.upload({c.a.c0 + c.a.c1}, c.a.shift);
  }
  d->g.a.silu = c.a.silu;
  if (!c.map.empty()) d->g.a.map = ctx.upload({c.m, c.taps}, c.map, Type::i32);
  if (!c.bias.empty()) d->g.bias = ctx.upload({c.n}, c.bias);
  if (!c.residual.empty()) d->g.residual = ctx.upload({c.m, c.n}, c.residual);
  d->g.activation = static_cast<Activation>(c.act);
  d->g.out = ctx.upload({c.m, c.n}, test::nans(count(c.m, c.n)));
  return d;
}

// Float32 sums of k products of numbers up to about 2 have an error of about 1e-7 sqrt(k) of the largest: 1e-5 covers k
// = 2000.
constexpr double kTolerance = 1e-5;

class GemmTest : public test::FlavourTest {
 protected:
  void expect_matches(const Try& t) {
    SCOPED_TRACE(fmt::format("m {} n {} k {}+{} taps {} affine {} silu {} bias {} residual {} act {}", t.m, t.n, t.k,
                             t.c1, t.taps, t.affine, t.silu, t.bias, t.residual, static_cast<int>(t.act)));
    const ref::GemmCase c = make_case(t);
    const auto d = upload(ctx(), c);
    gemm(ctx(), d->g);
    EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), c.all(), kTolerance));
  }
};

TEST_P(GemmTest, EverySizeMatchesReference) {
  for (const long m : {1, 3, 11, 12, 13, 25})
    for (const long n : {1, 7, 22, 23, 31, 32, 33, 64})
      for (const long k : {1, 15, 16, 17, 35}) expect_matches({m, n, k});
  expect_matches({130, 97, 71});
  expect_matches({65, 129, 300});
}

TEST_P(GemmTest, EveryCompositionMatchesReference) {
  for (const long c1 : {0L, 5L, 16L})
    for (const bool affine : {false, true})
      for (const bool silu : {false, true})
        for (const long taps : {0L, 1L, 8L, 27L}) {
          Try t{13, 33, 19, c1};
          t.affine = affine, t.silu = silu, t.taps = taps;
          expect_matches(t);
          t.k = 32;
          expect_matches(t);
          t.n = 36;  // rows of a multiple of four elements
          expect_matches(t);
        }
}

TEST_P(GemmTest, EveryEpilogueMatchesReference) {
  for (const bool bias : {false, true})
    for (const bool residual : {false, true})
      for (const auto act : {Activation::none, Activation::gelu, Activation::silu})
        for (const long n : {20L, 22L, 64L}) {
          Try t{25, n, 18};
          t.bias = bias, t.residual = residual, t.act = act;
          expect_matches(t);
        }
}

// GELU in the range where it is neither 0 nor x, to within a few roundings of the largest value.
TEST_P(GemmTest, GeluIsExactEverywhere) {
  ref::GemmCase c = make_case({1, 1, 1});
  c.m = c.a.rows = 2000, c.act = 1, c.w = {1.0f}, c.bias = {0.0f};
  c.a.x0.clear();
  for (int i = 0; i < 2000; ++i) c.a.x0.push_back(-8.0f + 0.008f * static_cast<float>(i));
  const auto d = upload(ctx(), c);
  gemm(ctx(), d->g);
  EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), c.all(), 2.5e-7));
}

// Enough tiles that the gpu flavour uses large ones, two per unit, with tails in both directions.
TEST_P(GemmTest, LargeTilesMatchReference) {
  const long side = 128L * ctx().device().compute_units + 5;
  Try t{side, 134, 37};
  t.residual = true, t.act = Activation::silu;
  expect_matches(t);
  t.n = 5, t.m = 300;  // few columns: no large tiles
  expect_matches(t);
}

// Values at which a naive exponential overflows.
TEST_P(GemmTest, SiluOfLargeValuesIsFinite) {
  ref::GemmCase c = make_case({1, 1, 1});
  c.m = c.a.rows = 401, c.act = 2, c.w = {1.0f}, c.bias = {0.0f};
  c.a.x0.clear();
  for (int i = 0; i <= 400; ++i) c.a.x0.push_back(static_cast<float>(i - 200));
  const auto d = upload(ctx(), c);
  gemm(ctx(), d->g);
  EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), c.all(), 1e-7));
}

TEST_P(GemmTest, EmptyIsNothing) {
  for (const long m : {0L, 4L}) {
    const ref::GemmCase c = make_case({m, m ? 0L : 5L, 3});
    const auto d = upload(ctx(), c);
    gemm(ctx(), d->g);
    EXPECT_EQ(ctx().read<float>(d->g.out).size(), 0u);
  }
}

// An empty sum is zero, which leaves act(bias) + residual.
TEST_P(GemmTest, NoTermsLeaveBiasAndResidual) {
  Try t{5, 7, 0};
  t.residual = true, t.act = Activation::silu;
  expect_matches(t);
}

// Rows outside the range stay unchanged.
TEST_P(GemmTest, RowRangeTouchesOnlyItsRows) {
  for (const long taps : {0L, 3L}) {
    Try t{40, 33, 20};
    t.taps = taps, t.residual = true;
    const ref::GemmCase c = make_case(t);
    const auto d = upload(ctx(), c);
    const auto before = random_floats(count(t.m, t.n), 99);
    ctx().write(d->g.out, before.data());
    d->g.row0 = 7, d->g.rows = 14;
    gemm(ctx(), d->g);
    const auto want = c.all();
    std::vector<double> expected(before.begin(), before.end());
    for (long i = 7 * t.n; i < 21 * t.n; ++i) expected[static_cast<std::size_t>(i)] = want[static_cast<std::size_t>(i)];
    EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), expected, kTolerance));
  }
}

// A block of A in scratch memory is written to its place in a larger output.
TEST_P(GemmTest, OutputMayStartElsewhereThanA) {
  const ref::GemmCase c = make_case({9, 33, 20});
  const auto d = upload(ctx(), c);
  const auto before = random_floats(count(30, c.n), 99);
  d->g.out = ctx().upload({30, c.n}, before);
  d->g.out_row0 = 13;
  gemm(ctx(), d->g);
  const auto want = c.all();
  std::vector<double> expected(before.begin(), before.end());
  for (std::size_t i = 0; i < want.size(); ++i) expected[count(13, c.n) + i] = want[i];
  EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), expected, kTolerance));
}

TEST_P(GemmTest, ResidualMayBeTheOutput) {
  Try t{30, 40, 21};
  t.residual = true, t.act = Activation::silu;
  const ref::GemmCase c = make_case(t);
  const auto d = upload(ctx(), c);
  d->g.out = d->g.residual;
  gemm(ctx(), d->g);
  EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), c.all(), kTolerance));
}

// Large enough to be packed in several pieces.
TEST_P(GemmTest, LongGathersAreCutIntoPieces) {
  Try t{800, 7, 128};
  t.taps = 27;
  const ref::GemmCase c = make_case(t);
  const auto d = upload(ctx(), c);
  gemm(ctx(), d->g);
  EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), c.all(), kTolerance));
}

// The cpu flavour reads A's rows in place; with a map that gathers each row unchanged, they are packed.
TEST_P(GemmTest, RowsThatArePackedGiveTheSameBits) {
  for (const long m : {12, 13, 23, 24, 97, 205})
    for (const long n : {1, 16, 17, 23, 24, 25, 32, 65})
      for (const auto& [k, c1] : {std::pair{1L, 0L}, {31L, 2L}, {200L, 0L}, {256L, 1L}, {300L, 257L}, {512L, 0L}}) {
        Try t{m, n, k, c1};
        t.residual = true, t.act = Activation::silu;
        SCOPED_TRACE(fmt::format("m {} n {} k {}+{}", m, n, k, c1));
        const ref::GemmCase c = make_case(t);
        const auto d = upload(ctx(), c);
        gemm(ctx(), d->g);
        const auto lying = ctx().read<float>(d->g.out);
        if (m < 97) {
          EXPECT_TRUE(test::close(lying, c.all(), kTolerance));
        }
        std::vector<int> same(count(m, 1));
        std::iota(same.begin(), same.end(), 0);
        d->g.a.map = ctx().upload({m, 1}, same, Type::i32);
        ctx().write(d->g.out, test::nans(lying.size()).data());
        gemm(ctx(), d->g);
        if (ctx().flavour() == Flavour::cpu)
          EXPECT_EQ(ctx().read<float>(d->g.out), lying);
        else
          EXPECT_TRUE(
              test::close(ctx().read<float>(d->g.out), std::vector<double>(lying.begin(), lying.end()), kTolerance));
      }
}

TEST_P(GemmTest, SameBitsTwice) {
  Try t{100, 70, 50, 14};
  t.affine = t.silu = t.residual = true, t.taps = 3, t.act = Activation::gelu;
  const ref::GemmCase c = make_case(t);
  const auto d = upload(ctx(), c);
  gemm(ctx(), d->g);
  const auto first = ctx().read<float>(d->g.out);
  ctx().write(d->g.out, test::nans(first.size()).data());
  gemm(ctx(), d->g);
  EXPECT_EQ(ctx().read<float>(d->g.out), first);
}

TEST_P(GemmTest, PlanTakesTheSameMemory) {
  Try t{500, 70, 40};
  t.taps = 27;
  const ref::GemmCase c = make_case(t);
  const auto own = test::open_context(GetParam());
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) gemm(*at, upload(*at, c)->g);
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
}

TEST_P(GemmTest, RejectsBadShapes) {
  const ref::GemmCase c = make_case({5, 6, 7});
  const auto d = upload(ctx(), c);
  const auto rejects = [&](auto change) {
    Gemm g = d->g;
    change(g);
    EXPECT_THROW(gemm(ctx(), g), Error);
  };
  rejects([](Gemm& g) { g.b = nullptr; });
  rejects([](Gemm& g) { g.a.x0 = Tensor(); });
  rejects([&](Gemm& g) { g.a.x0 = ctx().tensor({5, 8}); });
  rejects([&](Gemm& g) { g.a.x1 = ctx().tensor({5, 1}); });
  rejects([&](Gemm& g) { g.a.scale = ctx().tensor({7}); });
  rejects([&](Gemm& g) { g.a.map = ctx().tensor({5, 2}, Type::i32); });
  rejects([&](Gemm& g) { g.bias = ctx().tensor({5}); });
  rejects([&](Gemm& g) { g.residual = ctx().tensor({5, 5}); });
  rejects([&](Gemm& g) { g.out = ctx().tensor({4, 6}); });
  rejects([](Gemm& g) { g.row0 = 1, g.rows = 5; });
  rejects([](Gemm& g) { g.out_row0 = 1; });
}

VSPLAT_FLAVOURS(GemmTest);

}  // namespace
}  // namespace vsplat

#include "runtime/gemm.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numeric>

#include "model/diagnose/selftest/inputs/products.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

using selftest::gemm_case;
using selftest::upload_product;
using test::random_floats;

// Float32 sums of k products of numbers up to about 2 have an error of about 1e-7 sqrt(k) of the largest: 1e-5 covers k
// = 2000.
constexpr double kTolerance = 1e-5;

class GemmTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(GemmTest);
VSPLAT_OPERATION(GemmTest, gemm)

// GELU in the range where it is neither 0 nor x, to within a few roundings of the largest value; SiLU of values at
// which a naive exponential overflows.
TEST_P(GemmTest, ActivationsAreExactEverywhere) {
  for (const auto& [act, count, first, step, tolerance] :
       {std::tuple{1, 2000L, -8.0f, 0.008f, 2.5e-7}, {2, 401L, -200.0f, 1.0f, 1e-7}}) {
    ref::GemmCase c = gemm_case({count, 1, 1});
    c.act = act, c.w = {1.0f}, c.bias = {0.0f};
    for (std::size_t i = 0; i < c.a.x0.size(); ++i) c.a.x0[i] = first + step * static_cast<float>(i);
    const auto d = upload_product(ctx(), c);
    gemm(ctx(), d->g);
    EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), c.all(), tolerance)) << act;
  }
}

// Rows outside the range stay unchanged.
TEST_P(GemmTest, RowRangeTouchesOnlyItsRows) {
  for (const long taps : {0L, 3L}) {
    const ref::GemmCase c = gemm_case({40, 33, 20, 0, false, taps, 0, true, true});
    const auto d = upload_product(ctx(), c);
    const auto before = random_floats(40 * 33, 99);
    ctx().write(d->g.out, before.data());
    d->g.row0 = 7, d->g.rows = 14;
    gemm(ctx(), d->g);
    const auto want = c.all();
    auto expected = test::as_doubles(before);
    std::copy(want.begin() + 7 * 33, want.begin() + 21 * 33, expected.begin() + 7 * 33);
    EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), expected, kTolerance));
  }
}

// A block of A in scratch memory is written to its place in a larger output.
TEST_P(GemmTest, OutputMayStartElsewhereThanA) {
  const ref::GemmCase c = gemm_case({9, 33, 20, 0, false, 0, 0, true});
  const auto d = upload_product(ctx(), c);
  const auto before = random_floats(30 * 33, 99);
  d->g.out = ctx().upload({30, c.n}, before);
  d->g.out_row0 = 13;
  gemm(ctx(), d->g);
  const auto want = c.all();
  auto expected = test::as_doubles(before);
  std::copy(want.begin(), want.end(), expected.begin() + 13 * 33);
  EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), expected, kTolerance));
}

// The cpu flavour reads A's rows in place; with a map that gathers each row unchanged, they are packed.
TEST_P(GemmTest, RowsThatArePackedGiveTheSameBits) {
  for (const long m : {12, 13, 23, 24, 97, 205})
    for (const long n : {1, 16, 17, 23, 24, 25, 32, 65})
      for (const auto& [k, c1] : {std::pair{1L, 0L}, {31L, 2L}, {200L, 0L}, {256L, 1L}, {300L, 257L}, {512L, 0L}}) {
        SCOPED_TRACE(fmt::format("m {} n {} k {}+{}", m, n, k, c1));
        const ref::GemmCase c = gemm_case({m, n, k + c1, c1, false, 0, 2, true, true});
        const auto d = upload_product(ctx(), c);
        gemm(ctx(), d->g);
        const auto lying = ctx().read<float>(d->g.out);
        if (m < 97) {
          EXPECT_TRUE(test::close(lying, c.all(), kTolerance));
        }
        std::vector<int> same(static_cast<std::size_t>(m));
        std::iota(same.begin(), same.end(), 0);
        d->g.a.map = ctx().upload({m, 1}, same, Type::i32);
        ctx().write(d->g.out, test::nans(lying.size()).data());
        gemm(ctx(), d->g);
        if (ctx().flavour() == Flavour::cpu)
          EXPECT_EQ(ctx().read<float>(d->g.out), lying);
        else
          EXPECT_TRUE(test::close(ctx().read<float>(d->g.out), lying, kTolerance));
      }
}

TEST_P(GemmTest, PlanTakesTheSameMemory) {
  const ref::GemmCase c = gemm_case({500, 70, 40, 0, false, 27, 0, true});
  const auto own = test::open_context(GetParam());
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) gemm(*at, upload_product(*at, c)->g);
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
}

TEST_P(GemmTest, RejectsBadShapes) {
  const ref::GemmCase c = gemm_case({5, 6, 7, 0, false, 0, 0, true});
  const auto d = upload_product(ctx(), c);
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

}  // namespace
}  // namespace vsplat

// GEMM features for training: operands packed on the device, and products over all rows.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "runtime/column_sum.h"
#include "runtime/gemm.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::random_floats;

std::size_t elements(long a, long b) { return static_cast<std::size_t>(a * b); }

constexpr double kProductTolerance = 1e-5;  // as in gemm_test.cpp

class GemmBackward : public test::FlavourTest {
 protected:
  void expect_product(long rows, long m, long n, float low = -1, double tolerance = kProductTolerance) {
    SCOPED_TRACE(fmt::format("{} rows, {} x {}", rows, m, n));
    const auto a = random_floats(elements(rows, m), 1, low), b = random_floats(elements(rows, n), 2, low);
    const auto before = random_floats(elements(m, n), 3);
    auto want = ref::transposed_product(a, b, static_cast<std::size_t>(rows), static_cast<std::size_t>(m),
                                        static_cast<std::size_t>(n));
    TransposedGemm g;
    g.a = ctx().upload({rows, m}, a);
    g.b = ctx().upload({rows, n}, b);
    g.out = ctx().upload({m, n}, test::nans(elements(m, n)));
    transposed_gemm(ctx(), g);
    EXPECT_TRUE(test::close(ctx().read<float>(g.out), want, tolerance));
    ctx().write(g.out, before.data());
    g.add = true;
    transposed_gemm(ctx(), g);
    for (std::size_t i = 0; i < want.size(); ++i) want[i] += before[i];
    EXPECT_TRUE(test::close(ctx().read<float>(g.out), want, tolerance)) << "added";
  }
};
VSPLAT_FLAVOURS(GemmBackward);

// The device packs the same bits as the host, for either order of strides.
TEST_P(GemmBackward, TheDevicePacksAsTheHostDoes) {
  for (const long k : {1L, 3L, 15L, 63L, 64L, 65L, 130L})
    for (const long n : {1L, 7L, 16L, 31L, 32L, 33L, 97L}) {
      const auto w = random_floats(elements(k, n), 1);
      const Tensor on_device = ctx().upload({k, n}, w);
      for (const auto& [k_stride, n_stride] : {std::pair<long, long>{1, k}, {n, 1}}) {
        const PackedMatrix want = pack_matrix(ctx(), w.data(), k, n, k_stride, n_stride, "w");
        const PackedMatrix got = pack_matrix(ctx(), on_device, k, n, k_stride, n_stride, "w");
        ASSERT_EQ(got.data.shape(), want.data.shape());
        EXPECT_EQ(ctx().read<float>(got.data), ctx().read<float>(want.data)) << k << " x " << n << " by " << k_stride;
        EXPECT_EQ(got.k, k);
        EXPECT_EQ(got.n, n);
      }
    }
}

// A part of a matrix, such as a Linear's weight for one of two inputs side by side.
TEST_P(GemmBackward, APartIsPackedFromItsFirstElementOn) {
  constexpr long rows = 19, all = 37, from = 5, part = 21;
  const auto w = random_floats(elements(rows, all), 1);
  const Tensor on_device = ctx().upload({rows, all}, w);
  const auto expect_same = [&](const PackedMatrix& got, const PackedMatrix& want) {
    EXPECT_EQ(ctx().read<float>(got.data), ctx().read<float>(want.data));
  };
  expect_same(pack_matrix(ctx(), on_device, part, rows, 1, all, "w", from),
              pack_matrix(ctx(), w.data() + from, part, rows, 1, all, "w"));
  expect_same(pack_matrix(ctx(), on_device, rows, part, all, 1, "w", from),
              pack_matrix(ctx(), w.data() + from, rows, part, all, 1, "w"));
  EXPECT_THROW(pack_matrix(ctx(), on_device, rows, part, all, 1, "w", all - part + 1), Error);
}

// If CLBlast is forced on the cpu flavour, it has its own copy.
TEST_P(GemmBackward, ThePlainCopyIsPackedToo) {
  ContextOptions options;
  options.gemm = GemmChoice::clblast;
  const auto own = test::open_context(GetParam(), options);
  const auto w = random_floats(elements(35, 17), 1);
  const PackedMatrix got = pack_matrix(*own, own->upload({35, 17}, w), 17, 35, 1, 17, "w");
  const PackedMatrix want = pack_matrix(*own, w.data(), 17, 35, 1, 17, "w");
  EXPECT_EQ(static_cast<bool>(got.plain), static_cast<bool>(want.plain));
  if (want.plain) {
    EXPECT_EQ(own->read<float>(got.plain), own->read<float>(want.plain));
  }
}

TEST_P(GemmBackward, ProductsOverRowsMatchReferenceAtEverySizeThatBreaksThings) {
  for (const long rows : {1L, 3L, 17L, 65L})
    for (const long m : {1L, 7L, 11L, 12L, 13L, 65L})
      for (const long n : {1L, 7L, 31L, 32L, 33L, 65L, 66L}) expect_product(rows, m, n);
  for (const long rows : {1023L, 1024L, 1025L, 3001L}) expect_product(rows, 13, 35);
  expect_product(1300, 130, 133);
}

// With many columns, memory suffices for only one or two sums at a time.
TEST_P(GemmBackward, SumsAreMadeInSeveralRounds) {
  expect_product(5000, 2800, 3);
  expect_product(2500, 4500, 2);
}

// All voxels of a 64^3 grid with the same sign, so that rounding errors grow with the number of terms.
TEST_P(GemmBackward, LongSumsKeepTheirDigits) { expect_product(262144, 5, 9, 0.0f, 2e-6); }

// A Linear's three gradients against differences of its loss, which are exact, since the loss is linear in each.
TEST_P(GemmBackward, LinearGradientsAreThoseOfDifferences) {
  const long m = 5, n = 6, k = 7;
  ref::GemmCase c;
  c.m = c.a.rows = m, c.n = n, c.k = c.a.c0 = k;
  c.a.x0 = random_floats(elements(m, k), 1), c.w = random_floats(elements(n, k), 2),
  c.bias = random_floats(elements(n, 1), 3);
  const auto dy = random_floats(elements(m, n), 4);
  const auto differences = [&](std::vector<float>& v) {
    return ref::linear_differences(v, [&] { return ref::weighed(c.all(), dy); });
  };
  const Tensor x = ctx().upload({m, k}, c.a.x0), w = ctx().upload({n, k}, c.w), up = ctx().upload({m, n}, dy);
  const Tensor dx = ctx().tensor({m, k}), dw = ctx().tensor({n, k}), db = ctx().tensor({n});
  const PackedMatrix packed = pack_matrix(ctx(), w, n, k, k, 1, "w");
  Gemm by_x;
  by_x.a.x0 = up, by_x.b = &packed, by_x.out = dx;
  gemm(ctx(), by_x);
  transposed_gemm(ctx(), {up, x, dw});
  column_sum(ctx(), {up, db});
  EXPECT_TRUE(test::close(ctx().read<float>(dx), differences(c.a.x0), 1e-6));
  EXPECT_TRUE(test::close(ctx().read<float>(dw), differences(c.w), 1e-6));
  EXPECT_TRUE(test::close(ctx().read<float>(db), differences(c.bias), 1e-6));
}

TEST_P(GemmBackward, LeadingDimensionsAreRowsAndNoneGiveZero) {
  const Tensor a = ctx().upload({2, 1, 1}, std::vector<float>{2, 3}),
               b = ctx().upload({1, 2, 1}, std::vector<float>{5, 7});
  const Tensor out = ctx().upload({1, 1}, std::vector<float>{9});
  transposed_gemm(ctx(), {ctx().tensor({0, 1}), ctx().tensor({0, 1}), out, true});
  EXPECT_EQ(ctx().read<float>(out)[0], 9);
  transposed_gemm(ctx(), {a, b, out});
  EXPECT_EQ(ctx().read<float>(out)[0], 31);
  transposed_gemm(ctx(), {ctx().tensor({0, 1}), ctx().tensor({0, 1}), out});
  EXPECT_EQ(ctx().read<float>(out)[0], 0);
}

TEST_P(GemmBackward, SameBitsTwice) {
  const Tensor a = ctx().upload({5000, 33}, random_floats(elements(5000, 33), 1));
  const Tensor b = ctx().upload({5000, 40}, random_floats(elements(5000, 40), 2)), out = ctx().tensor({33, 40});
  transposed_gemm(ctx(), {a, b, out});
  const auto first = ctx().read<float>(out);
  transposed_gemm(ctx(), {a, b, out});
  EXPECT_EQ(ctx().read<float>(out), first);
}

TEST_P(GemmBackward, PlanTakesTheSameMemory) {
  const auto own = test::open_context(GetParam());
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) {
    const Tensor a = at->tensor({5000, 33}), b = at->tensor({5000, 40});
    transposed_gemm(*at, {a, b, at->tensor({33, 40})});
    pack_matrix(*at, a, 33, 5000, 1, 33, "w");
  }
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
}

TEST_P(GemmBackward, RejectsBadShapes) {
  const Tensor a = ctx().tensor({5, 6}), b = ctx().tensor({5, 7}), c = ctx().tensor({4, 7});
  const Tensor out = ctx().tensor({6, 7});
  EXPECT_THROW(transposed_gemm(ctx(), {a, c, out}), Error);
  EXPECT_THROW(transposed_gemm(ctx(), {b, a, out}), Error);
  EXPECT_THROW(transposed_gemm(ctx(), {a, Tensor(), out}), Error);
  EXPECT_THROW(pack_matrix(ctx(), a, 5, 7, 6, 1, "w"), Error);
  EXPECT_THROW(pack_matrix(ctx(), ctx().tensor({5, 6}, Type::i32), 5, 6, 6, 1, "w"), Error);
}

}  // namespace
}  // namespace vsplat

// GEMM features for training: operands packed on the device, and products over all rows.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "model/diagnose/selftest/inputs/products.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "runtime/column_sum.h"
#include "runtime/gemm.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::random_floats;

std::size_t elements(long a, long b) { return static_cast<std::size_t>(a * b); }

class GemmBackward : public test::FlavourTest {};
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

// A Linear's three gradients against differences of its loss, which are exact, since the loss is linear in each.
TEST_P(GemmBackward, LinearGradientsAreThoseOfDifferences) {
  const long m = 5, n = 6, k = 7;
  ref::GemmCase c = selftest::gemm_case({m, n, k, 0, false, 0, 0, true});
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

// The same products with CLBlast, which takes ten seconds to compile on a CPU.
#include <gtest/gtest.h>

#include "model/diagnose/selftest/reference/gemm.h"
#include "runtime/gemm.h"
#include "runtime/profile/profile_text.h"
#include "runtime/profile/profiler.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::random_floats;

class GemmClblastTest : public ::testing::TestWithParam<Flavour> {
 protected:
  static Context& ctx(Flavour flavour) {
    static std::unique_ptr<Context> contexts[2];
    auto& slot = contexts[flavour == Flavour::gpu];
    ContextOptions options;
    options.gemm = GemmChoice::clblast;
    if (!slot) slot = test::open_context(flavour, options);
    return *slot;
  }
};

struct Product {
  ref::GemmCase c;
  PackedMatrix b;
  Gemm g;
};

Product make(Context& ctx, long m, long n, long k, Activation act, bool residual) {
  const auto count = [](long a, long b) { return static_cast<std::size_t>(a * b); };
  Product r;
  r.c.m = r.c.a.rows = m, r.c.n = n, r.c.k = r.c.a.c0 = k, r.c.act = static_cast<int>(act);
  r.c.a.x0 = random_floats(count(m, k), 1);
  r.c.w = random_floats(count(n, k), 2);
  r.c.bias = random_floats(count(n, 1), 3);
  if (residual) r.c.residual = random_floats(count(m, n), 4);
  r.b = pack_matrix(ctx, r.c.w.data(), k, n, 1, k, "weight");
  r.g.a.x0 = ctx.upload({m, k}, r.c.a.x0);
  r.g.bias = ctx.upload({n}, r.c.bias);
  if (residual) r.g.residual = ctx.upload({m, n}, r.c.residual);
  r.g.activation = act;
  r.g.out = ctx.upload({m, n}, test::nans(count(m, n)));
  r.g.name = "through_clblast";
  return r;
}

TEST_P(GemmClblastTest, MatchesReference) {
  Context& c = ctx(GetParam());
  c.profiler().enable(true);
  struct Size {
    long m, n, k;
  };
  for (const Size& size : {Size{5, 7, 3}, {33, 65, 40}, {300, 130, 257}, {513, 500, 490}})
    for (const bool residual : {false, true}) {
      Product r = make(c, size.m, size.n, size.k, residual ? Activation::gelu : Activation::none, residual);
      r.g.b = &r.b;
      gemm(c, r.g);
      EXPECT_TRUE(test::close(c.read<float>(r.g.out), r.c.all(), 1e-5));
      if (!residual) continue;
      r.g.out = r.g.residual;  // the residual may be the output
      gemm(c, r.g);
      EXPECT_TRUE(test::close(c.read<float>(r.g.out), r.c.all(), 1e-5));
    }
  c.finish();
  bool found = false;
  for (const ProfileRow& row : c.profiler().rows()) found = found || (row.name == "through_clblast" && row.calls == 12);
  EXPECT_TRUE(found) << "CLBlast's launches are missing from the profile\n" << profile_table(c.profiler().profile());
}

TEST_P(GemmClblastTest, RowRangeTouchesOnlyItsRows) {
  Context& c = ctx(GetParam());
  Product r = make(c, 40, 33, 20, Activation::silu, true);
  r.g.b = &r.b;
  const auto before = random_floats(40 * 33, 9);
  c.write(r.g.out, before.data());
  r.g.row0 = 7, r.g.rows = 14;
  gemm(c, r.g);
  const auto want = r.c.all();
  std::vector<double> expected(before.begin(), before.end());
  for (std::size_t i = 7 * 33; i < 21 * 33; ++i) expected[i] = want[i];
  EXPECT_TRUE(test::close(c.read<float>(r.g.out), expected, 1e-5));
}

TEST_P(GemmClblastTest, PlanTakesTheSameMemory) {
  Context& c = ctx(GetParam());
  const auto plan = c.planner();
  const auto before = c.memory().live();
  ASSERT_EQ(plan->memory().live(), before);
  c.memory().reset_peak();
  plan->memory().reset_peak();
  for (Context* at : {plan.get(), &c}) {
    Product r = make(*at, 513, 500, 490, Activation::gelu, true);
    r.g.b = &r.b;
    r.g.out = r.g.residual;
    gemm(*at, r.g);
  }
  c.finish();  // the driver may still be compiling at exit
  EXPECT_EQ(c.memory().peak_live(), plan->memory().peak_live());
}

INSTANTIATE_TEST_SUITE_P(Kernels, GemmClblastTest, ::testing::Values(Flavour::cpu, Flavour::gpu), test::flavour_name);

}  // namespace
}  // namespace vsplat

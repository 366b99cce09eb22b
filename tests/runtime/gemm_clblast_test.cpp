// The same products with CLBlast, which takes ten seconds to compile on a CPU.
#include <gtest/gtest.h>

#include <array>

#include "model/diagnose/selftest/inputs/products.h"
#include "runtime/profile/profile_text.h"
#include "runtime/profile/profiler.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using selftest::gemm_case;
using selftest::upload_product;
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

TEST_P(GemmClblastTest, MatchesReference) {
  Context& c = ctx(GetParam());
  c.profiler().enable(true);
  for (const auto& [m, n, k] : {std::array<long, 3>{5, 7, 3}, {33, 65, 40}, {300, 130, 257}, {513, 500, 490}})
    for (const bool residual : {false, true}) {
      const ref::GemmCase want = gemm_case({m, n, k, 0, false, 0, residual ? 1 : 0, true, residual});
      const auto d = upload_product(c, want);
      d->g.name = "through_clblast";
      gemm(c, d->g);
      EXPECT_TRUE(test::close(c.read<float>(d->g.out), want.all(), 1e-5));
      if (!residual) continue;
      d->g.out = d->g.residual;  // the residual may be the output
      gemm(c, d->g);
      EXPECT_TRUE(test::close(c.read<float>(d->g.out), want.all(), 1e-5));
    }
  c.finish();
  bool found = false;
  for (const ProfileRow& row : c.profiler().rows()) found = found || (row.name == "through_clblast" && row.calls == 12);
  EXPECT_TRUE(found) << "CLBlast's launches are missing from the profile\n" << profile_table(c.profiler().profile());
}

TEST_P(GemmClblastTest, RowRangeTouchesOnlyItsRows) {
  Context& c = ctx(GetParam());
  const ref::GemmCase all = gemm_case({40, 33, 20, 0, false, 0, 2, true, true});
  const auto d = upload_product(c, all);
  const auto before = random_floats(40 * 33, 9);
  c.write(d->g.out, before.data());
  d->g.row0 = 7, d->g.rows = 14;
  gemm(c, d->g);
  const auto want = all.all();
  std::vector<double> expected(before.begin(), before.end());
  for (std::size_t i = 7 * 33; i < 21 * 33; ++i) expected[i] = want[i];
  EXPECT_TRUE(test::close(c.read<float>(d->g.out), expected, 1e-5));
}

TEST_P(GemmClblastTest, PlanTakesTheSameMemory) {
  Context& c = ctx(GetParam());
  const auto plan = c.planner();
  const auto before = c.memory().live();
  ASSERT_EQ(plan->memory().live(), before);
  c.memory().reset_peak();
  plan->memory().reset_peak();
  for (Context* at : {plan.get(), &c}) {
    const auto d = upload_product(*at, gemm_case({513, 500, 490, 0, false, 0, 1, true, true}));
    d->g.out = d->g.residual;
    gemm(*at, d->g);
  }
  c.finish();  // the driver may still be compiling at exit
  EXPECT_EQ(c.memory().peak_live(), plan->memory().peak_live());
}

INSTANTIATE_TEST_SUITE_P(Kernels, GemmClblastTest, ::testing::Values(Flavour::cpu, Flavour::gpu), test::flavour_name);

}  // namespace
}  // namespace vsplat

// Products by AMX: by the processor if it has the instructions, else by an emulator of them, which computes what
// Intel's manual says. So the kernels are tested as they are on every x86 processor with avx512_bf16.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "model/diagnose/selftest/cases/cases.h"
#include "runtime/gemm_pairs.h"
#include "runtime/system/system_processor.h"
#include "runtime/tuning/matrix_probe.h"
#include "tests/support/amx_emulator.h"
#include "tests/support/device.h"
#include "tests/support/planted_kernels.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

std::unique_ptr<Context> open(MatrixUnit unit) {
  ContextOptions options;
  options.precision = Precision::mixed, options.matrix_unit = unit;
  return test::open_context(Flavour::cpu, options);
}

#ifdef __x86_64__
// One product of the instructions themselves, in the order of operands that the kernels use, with registers that are
// not full: [3, 2 pairs] times [2 pairs, 5].
TEST(AmxEmulator, ComputesWhatTheManualSays) {
  if (!may_use_amx() && !test::emulate_amx()) GTEST_SKIP() << "no Linux";
  alignas(64) std::uint8_t shapes[64] = {1};
  const auto shape = [&](int t, int rows, int words) { shapes[16 + 2 * t] = 4 * words, shapes[48 + t] = rows; };
  shape(0, 3, 5), shape(1, 3, 2), shape(2, 2, 5);
  std::uint16_t a[3][4], b[2][10];
  float sum[3][5], want[3][5];
  const auto bits = [](float x) {
    std::uint32_t all = 0;
    std::memcpy(&all, &x, 4);
    return static_cast<std::uint16_t>(all >> 16u);
  };
  const auto of_a = [](int m, int k) { return static_cast<float>(m + 1) * 0.5f + static_cast<float>(k); };
  const auto of_b = [](int k, int n) { return static_cast<float>(n - 2) * 0.25f - static_cast<float>(k); };
  for (int m = 0; m < 3; ++m)
    for (int k = 0; k < 4; ++k) a[m][k] = bits(of_a(m, k));
  for (int k = 0; k < 4; ++k)
    for (int n = 0; n < 5; ++n) b[k / 2][2 * n + k % 2] = bits(of_b(k, n));
  for (int m = 0; m < 3; ++m)
    for (int n = 0; n < 5; ++n) {
      sum[m][n] = want[m][n] = static_cast<float>(10 * m + n);
      for (int k = 0; k < 4; ++k) want[m][n] += of_a(m, k) * of_b(k, n);
    }
  const long before = test::emulated_instructions();
  __asm__ volatile(
      "ldtilecfg (%0)\n tileloadd (%1,%4,1), %%tmm0\n tileloadd (%2,%5,1), %%tmm1\n tileloadd (%3,%4,1), %%tmm2\n"
      "tdpbf16ps %%tmm2, %%tmm1, %%tmm0\n tilestored %%tmm0, (%1,%4,1)\n tilerelease" ::"r"(shapes),
      "r"(sum), "r"(a), "r"(b), "r"(20L), "r"(8L)
      : "memory");
  for (int m = 0; m < 3; ++m)
    for (int n = 0; n < 5; ++n) EXPECT_EQ(sum[m][n], want[m][n]) << m << ", " << n;
  EXPECT_EQ(test::emulated_instructions() - before, may_use_amx() ? 0 : 7);
}
#endif

class Amx : public ::testing::Test {
 protected:
  void SetUp() override {
    const DeviceInfo device = test::context(Flavour::cpu).device();
    const auto& units = device.matrix_units;
    if (std::find(units.begin(), units.end(), MatrixUnit::avx512bf16) == units.end())
      GTEST_SKIP() << "no avx512_bf16 instructions";
    if (!may_use_amx()) test::emulate_amx();
    before_ = test::emulated_instructions();
  }
  // The unit was indeed at work.
  void TearDown() override {
    if (IsSkipped() || may_use_amx()) return;
    EXPECT_GT(test::emulated_instructions(), before_);
  }
  long before_ = 0;
};

TEST_F(Amx, PassesItsTrial) { EXPECT_EQ(wrong_with_matrix_unit(*open(MatrixUnit::amx)), ""); }

// What is wrong with an operation's products of pairs by the self-test's cases; "" if nothing.
std::string first_wrong_case(Context& ctx, const char* stem) {
  std::size_t findings = 0;
  for (const selftest::Case& one : selftest::cases_of(stem)) {
    if (std::string(one.name).find("_pairs") == std::string::npos) continue;
    selftest::Checks checks(ctx, selftest::Sizes::all);
    checks.run(one.name, one.run);
    findings += checks.findings().size();
    for (const selftest::Finding& f : checks.findings()) {
      EXPECT_EQ(f.trouble, "") << f.what;  // such as a kernel that does not compile
      if (!f.right) return fmt::format("{}: off by {}, {} allowed {}", f.what, f.error, f.tolerance, f.trouble);
    }
  }
  return findings > 0 ? "" : "no cases";
}

// Products, Winograd's convolutions, attention, and their gradients.
TEST_F(Amx, IsRightInEveryCase) {
  const auto ctx = open(MatrixUnit::amx);
  for (const char* stem : {"gemm", "conv3d", "attention"}) EXPECT_EQ(first_wrong_case(*ctx, stem), "") << stem;
}

// Mistakes that a change may make: another operand, a lost tail of a sum, one register for another, a wrong step. Both
// the trial before the first use and the self-test find them.
TEST_F(Amx, IsNotUsedIfItIsWrong) {
  test::expect_found({{"amx.clh", "tdpbf16ps %%tmm\" #b \", %%tmm\" #a", "tdpbf16ps %%tmm\" #a \", %%tmm\" #b"},
                      {"amx.clh", "AMX_MULTIPLY(3, 5, 7)", "AMX_MULTIPLY(3, 4, 7)"},
                      {"gemm_amx_cpu.cl", "if (until > whole)", "if (until > whole + 1)"},
                      {"gemm_amx_cpu.cl", "if (k0 == 0) {", "if (k0 >= 0) {"},
                      {"gemm_pack_pairs_cpu.cl", "load_part(from + (size_t)r * step", "load_part(from"}},
                     [] { return wrong_with_matrix_unit(*open(MatrixUnit::amx)); });
  test::expect_found({{"gemm_amx_cpu.cl", "pairs_of(one, other)", "pairs_of(other, one)"}},
                     [] { return first_wrong_case(*open(MatrixUnit::amx), "gemm"); });
  test::expect_found({{"conv3d_winograd.cl", "(a) + 2 * BLOCK, BLOCK", "(a) + BLOCK, BLOCK"},
                      {"conv3d_winograd.cl", "AMX_PLANES(3, a + next)", "AMX_PLANES(3, a)"}},
                     [] { return first_wrong_case(*open(MatrixUnit::amx), "conv3d"); });
  test::expect_found({{"attention_amx.clh", "b + d * KEYS + 16", "b + d * KEYS"},
                      {"attention_amx.clh", "AMX_LOAD(4, w + j, STEP / 2)", "AMX_LOAD(4, w, STEP / 2)"}},
                     [] { return first_wrong_case(*open(MatrixUnit::amx), "attention"); });
}

// A processor that lacks the instructions does not meet them.
TEST(AmxUnit, IsUsedOnlyWhereTheProcessorHasIt) {
  const DeviceInfo device = test::context(Flavour::cpu).device();
  const bool announced =
      std::find(device.matrix_units.begin(), device.matrix_units.end(), MatrixUnit::amx) != device.matrix_units.end();
  EXPECT_EQ(announced, may_use_amx());
  if (announced) return;
  const test::Variable named("VSPLAT_MATRIX", "amx");
  test::expect_error(Status::device, {"VSPLAT_MATRIX=amx", "amx_bf16"},
                     [&] { choose_matrix_unit(device, "auto", {}); });
}

}  // namespace
}  // namespace vsplat

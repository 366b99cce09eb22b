// Matrix units are tested before use: correct ones pass; wrong ones, and those that do not compile, are left out and
// recorded.
#include "runtime/tuning/matrix_probe.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "runtime/gemm_matrix.h"
#include "runtime/program.h"
#include "tests/support/device.h"
#include "tests/support/planted_kernels.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using test::plant;

ContextOptions with_unit(MatrixUnit unit) {
  ContextOptions options;
  options.matrix_unit = unit;
  return options;
}

bool has(MatrixUnit unit) {
  const auto units = test::context(Flavour::cpu).device().matrix_units;
  return std::find(units.begin(), units.end(), unit) != units.end();
}

TEST(MatrixProbe, EmulatedUnitsPass) {
  for (const Flavour flavour : {Flavour::cpu, Flavour::gpu}) {
    const auto ctx = test::open_context(flavour, with_unit(MatrixUnit::emulated));
    if (flavour == Flavour::cpu && ctx->device().native_float_width < 4) continue;
    EXPECT_EQ(wrong_with_matrix_unit(*ctx), "") << name_of(flavour);
  }
}

// Each is a mistake that a back end may make: a swapped row, a swapped term, coarse sums, a wrong operand.
TEST(MatrixProbe, FindsWrongUnits) {
  test::expect_found(
      {{"matrix_emulated.clh", "from + MATRIX_ROW * stride", "from + (MATRIX_ROW ^ 1) * stride"},
       {"matrix_emulated.clh", "a.from[k]", "a.from[k ^ 1]"},
       {"matrix_emulated.clh", "  return sum;\n", "  return convert_float4(convert_int4(sum * 64.0f)) / 64.0f;\n"},
       {"gemm_matrix.clh", "there > 1 ? from[N]", "there > 1 ? from[0]"}},
      [] { return wrong_with_matrix_unit(*test::open_context(Flavour::gpu, with_unit(MatrixUnit::emulated))); });
}

// The same of pairs: halves that are mixed up, a term that is left out, a wrong operand, coarse sums.
TEST(MatrixProbe, FindsWrongPairs) {
  if (test::context(Flavour::cpu).device().native_float_width < 4) GTEST_SKIP() << "no vectors";
  test::expect_found(
      {{"pairs_cpu.clh", "as_float16(b << 16)", "as_float16(b & 0xffff0000u)"},
       {"pairs_cpu.clh", "(bits >> 16 & 1u);\n  const int16", "0x8000u;\n  const int16"},
       {"gemm_cpu.cl", "TILE_RUN(pa, pb, K)", "TILE_RUN(pa, pb, K - 1)"},
       {"term_tile_cpu.clh", "pair_dot(a_, tile_hi_", "pair_dot(a_, tile_lo_"}},
      [] { return wrong_with_matrix_unit(*test::open_context(Flavour::cpu, with_unit(MatrixUnit::emulated))); });
}

// A wrong instruction planted on purpose: the processor's unit is not used.
TEST(MatrixProbe, LeavesOutAWrongInstruction) {
  if (!has(MatrixUnit::avx512bf16)) GTEST_SKIP() << "no such instructions";
  const DeviceInfo device = test::context(Flavour::cpu).device();
  const test::TemporaryFolder cache, folder, both;
  const test::Variable kept("VSPLAT_CACHE_DIR", cache.string().c_str()), selftest("VSPLAT_SELFTEST", "");
  const MatrixUnit best = has(MatrixUnit::amx) ? MatrixUnit::amx : MatrixUnit::avx512bf16;
  EXPECT_EQ(choose_matrix_unit(device, "auto", {}), best);
  EXPECT_EQ(choose_matrix_unit(device, "cpu", {}), best);
  EXPECT_EQ(choose_matrix_unit(device, "gpu", {}), MatrixUnit::emulated);
  ASSERT_TRUE(plant(folder.path(), "pairs_cpu.clh", "vdpbf16ps %2, %1, %0", "vdpbf16ps %1, %1, %0"));
  const test::Variable one_wrong("VSPLAT_KERNEL_DIR", folder.string().c_str());
  ASSERT_TRUE(plant(both.path(), "amx.clh", "AMX_MULTIPLY(3, 5, 7)", "AMX_MULTIPLY(3, 4, 7)"));
  const test::Variable kernels("VSPLAT_KERNEL_DIR", both.string().c_str());
  EXPECT_EQ(choose_matrix_unit(device, "auto", {}), MatrixUnit::emulated);
  EXPECT_THROW(choose_matrix_unit(device, "cpu", {}), Error);
  ContextOptions options;
  options.precision = Precision::mixed;
  const Context ctx(options);
  EXPECT_EQ(ctx.matrix_unit(), MatrixUnit::emulated);
  EXPECT_EQ(ctx.flavour(), Flavour::gpu);
}

// On a processor without the instructions nothing changes, and their name is an error that says what is missing.
TEST(MatrixProbe, RefusesInstructionsThatTheProcessorLacks) {
  const test::Variable lowered("VSPLAT_LIMITS", "matrix=0");
  const DeviceInfo device = choose_device("");
  EXPECT_TRUE(device.matrix_units.empty());
  EXPECT_EQ(choose_matrix_unit(device, "auto", {}), MatrixUnit::emulated);
  EXPECT_THROW(choose_matrix_unit(device, "cpu", {}), Error);
  const test::Variable units("VSPLAT_MATRIX", "avx512bf16");
  test::expect_error(Status::device, {device.type == DeviceType::cpu ? "avx512_bf16" : "no CPU device"},
                     [&] { choose_matrix_unit(device, "auto", {}); });
}

// Units that this device lacks: their kernel does not compile, which a file in the cache records.
TEST(MatrixProbe, LeavesOutWhatDoesNotCompileAndRemembersIt) {
  const DeviceInfo device = test::context(Flavour::gpu).device();
  if (device.type != DeviceType::cpu) GTEST_SKIP() << "a device that may have them";
  const test::TemporaryFolder cache;
  const test::Variable folder("VSPLAT_CACHE_DIR", cache.string().c_str()), units("VSPLAT_MATRIX", "wmma,emulated"),
      selftest("VSPLAT_SELFTEST", "");
  const auto kept = [&] {
    std::size_t files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(cache.path()))
      files += entry.path().parent_path().filename() == "findings";
    return files;
  };
  EXPECT_EQ(choose_matrix_unit(device, "auto", {}), MatrixUnit::emulated);
  EXPECT_EQ(kept(), 1u);
  EXPECT_EQ(choose_matrix_unit(device, "auto", {}), MatrixUnit::emulated);
  ContextOptions options;
  options.precision = Precision::mixed;
  EXPECT_EQ(Context(options).matrix_unit(), MatrixUnit::emulated);
  EXPECT_EQ(kept(), 1u);
}

TEST(MatrixProbe, UnknownNamesAreRefusedInAnyPrecision) {
  for (const char* names : {"ptx,tensor", "tensor", "ptx,,emulated"}) {
    const test::Variable units("VSPLAT_MATRIX", names);
    EXPECT_THROW(list_devices(), Error) << names;
  }
  const test::Variable units("VSPLAT_MATRIX", "ptx,avx512bf16,emulated");
  EXPECT_NO_THROW(list_devices());
}

}  // namespace
}  // namespace vsplat

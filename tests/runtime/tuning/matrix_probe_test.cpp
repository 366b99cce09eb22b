// Matrix units are tested before use: correct ones pass; wrong ones, and those that do not compile, are left out and
// recorded.
#include "runtime/tuning/matrix_probe.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "runtime/gemm_matrix.h"
#include "runtime/kernel_files.h"
#include "runtime/program.h"
#include "tests/support/device.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

ContextOptions with_unit(MatrixUnit unit) {
  ContextOptions options;
  options.matrix_unit = unit;
  return options;
}

TEST(MatrixProbe, EmulatedUnitsPass) {
  const auto ctx = test::open_context(Flavour::gpu, with_unit(MatrixUnit::emulated));
  EXPECT_EQ(wrong_with_matrix_unit(*ctx), "");
}

// Each is a mistake that a back end may make: a swapped row, a swapped term, coarse sums, a wrong operand.
TEST(MatrixProbe, FindsWrongUnits) {
  const struct {
    const char *file, *right, *wrong;
  } mistakes[] = {
      {"matrix_emulated.clh", "from + MATRIX_ROW * stride", "from + (MATRIX_ROW ^ 1) * stride"},
      {"matrix_emulated.clh", "a.from[k]", "a.from[k ^ 1]"},
      {"matrix_emulated.clh", "  return sum;\n", "  return convert_float4(convert_int4(sum * 64.0f)) / 64.0f;\n"},
      {"gemm_matrix.clh", "there > 1 ? from[N]", "there > 1 ? from[0]"}};
  for (const auto& mistake : mistakes) {
    const test::TemporaryFolder folder;
    bool made = false;
    for (const std::string& name : kernel_file_names()) {
      std::string text = kernel_text(name);
      if (name == mistake.file)
        for (std::size_t at = 0; (at = text.find(mistake.right, at)) != std::string::npos; at += 1) {
          text.replace(at, std::string(mistake.right).size(), mistake.wrong);
          made = true;
          break;
        }
      std::ofstream(folder / name) << text;
    }
    ASSERT_TRUE(made) << mistake.right;
    const test::Variable kernels("VSPLAT_KERNEL_DIR", folder.string().c_str());
    const auto ctx = test::open_context(Flavour::gpu, with_unit(MatrixUnit::emulated));
    EXPECT_NE(wrong_with_matrix_unit(*ctx), "") << mistake.wrong;
  }
}

// Units that this device lacks: their kernel does not compile, which a file in the cache records.
TEST(MatrixProbe, LeavesOutWhatDoesNotCompileAndRemembersIt) {
  const DeviceInfo device = test::context(Flavour::gpu).device();
  if (!device.matrix_units.empty()) GTEST_SKIP() << "a device that may have them";
  const test::TemporaryFolder cache;
  const test::Variable folder("VSPLAT_CACHE_DIR", cache.string().c_str()), units("VSPLAT_MATRIX", "wmma,emulated"),
      judged("VSPLAT_SELFTEST", "");
  const auto kept = [&] {
    std::size_t files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(cache.path()))
      files += entry.path().parent_path().filename() == "findings";
    return files;
  };
  EXPECT_EQ(choose_matrix_unit(device), MatrixUnit::emulated);
  EXPECT_EQ(kept(), 1u);
  EXPECT_EQ(choose_matrix_unit(device), MatrixUnit::emulated);
  ContextOptions options;
  options.precision = Precision::mixed;
  EXPECT_EQ(Context(options).matrix_unit(), MatrixUnit::emulated);
  EXPECT_EQ(kept(), 1u);
}

TEST(MatrixProbe, RefusesUnknownNames) {
  const test::Variable units("VSPLAT_MATRIX", "ptx,tensor");
  EXPECT_THROW(choose_matrix_unit(test::context(Flavour::gpu).device()), Error);
}

}  // namespace
}  // namespace vsplat

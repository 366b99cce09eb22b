// What multiplies in tests of mixed precision: emulated units of either flavour, and the processor's instructions if it
// has them, with every product rounded, however small. AMX's are computed by amx_emulator.h if only they are missing.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <tuple>

#include "runtime/system/system_processor.h"
#include "tests/support/amx_emulator.h"
#include "tests/support/device.h"
#include "tests/support/variable.h"

namespace vsplat::test {

struct MixedUnit {
  Flavour flavour;
  MatrixUnit unit;
};

inline const auto kMixedUnits =
    ::testing::Values(MixedUnit{Flavour::gpu, MatrixUnit::emulated}, MixedUnit{Flavour::cpu, MatrixUnit::emulated},
                      MixedUnit{Flavour::cpu, MatrixUnit::avx512bf16}, MixedUnit{Flavour::cpu, MatrixUnit::amx});

// Tests of golden vectors by name and unit. Skipped if the device lacks the unit.
class MixedTest : public ::testing::TestWithParam<std::tuple<const char*, MixedUnit>> {
 protected:
  void SetUp() override {
    const DeviceInfo device = context(Flavour::cpu).device();
    const auto& units = device.matrix_units;
    if (flavour() == Flavour::cpu && device.native_float_width < 4) GTEST_SKIP() << "no vectors";
    if (unit() != MatrixUnit::emulated && std::find(units.begin(), units.end(), MatrixUnit::avx512bf16) == units.end())
      GTEST_SKIP() << "no such instructions";
    if (unit() == MatrixUnit::amx && !may_use_amx()) emulate_amx();
  }
  static const char* name() { return std::get<0>(GetParam()); }
  static Flavour flavour() { return std::get<1>(GetParam()).flavour; }
  static MatrixUnit unit() { return std::get<1>(GetParam()).unit; }
  static std::unique_ptr<Context> open() {
    ContextOptions options;
    options.precision = Precision::mixed, options.matrix_unit = unit();
    return open_context(flavour(), options);
  }

 private:
  Variable every_product_{"VSPLAT_MATRIX_LEAST", "1"};
};

inline std::string mixed_name(const ::testing::TestParamInfo<MixedTest::ParamType>& info) {
  const auto& [name, unit] = info.param;
  return std::string(name) + "_" + name_of(unit.flavour) + "_" + name_of(unit.unit);
}

}  // namespace vsplat::test

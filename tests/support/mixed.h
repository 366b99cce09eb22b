// What multiplies in tests of mixed precision: emulated units of either flavour, and the processor's instructions if it
// has them. VSPLAT_MATRIX_LEAST=1 rounds products of any size.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>

#include "tests/support/device.h"
#include "tests/support/variable.h"

namespace vsplat::test {

struct MixedUnit {
  Flavour flavour;
  MatrixUnit unit;
  std::string name() const { return std::string(name_of(flavour)) + "_" + name_of(unit); }
};

inline const auto kMixedUnits =
    ::testing::Values(MixedUnit{Flavour::gpu, MatrixUnit::emulated}, MixedUnit{Flavour::cpu, MatrixUnit::emulated},
                      MixedUnit{Flavour::cpu, MatrixUnit::avx512bf16});

// Why this device cannot be tested with that unit; "" if it can.
inline std::string cannot_multiply(const MixedUnit& of) {
  const DeviceInfo device = context(Flavour::cpu).device();
  const auto& units = device.matrix_units;
  if (of.flavour == Flavour::cpu && device.native_float_width < 4) return "no vectors";
  if (of.unit != MatrixUnit::emulated && std::find(units.begin(), units.end(), of.unit) == units.end())
    return "no such instructions";
  return "";
}

inline std::unique_ptr<Context> open_mixed(const MixedUnit& of) {
  ContextOptions options;
  options.precision = Precision::mixed, options.matrix_unit = of.unit;
  return open_context(of.flavour, options);
}

}  // namespace vsplat::test

// Test suites that compare the device with files of vectors, each file with both kernel flavours.
#pragma once
#include <gtest/gtest.h>

#include <cctype>
#include <string>
#include <tuple>
#include <vector>

#include "tests/support/device.h"

namespace vsplat::test {

class VectorsTest : public ::testing::TestWithParam<std::tuple<Flavour, std::string>> {
 protected:
  Context& ctx() { return context(std::get<0>(GetParam())); }
  const std::string& name() { return std::get<1>(GetParam()); }
};

inline auto in_both_flavours(const std::vector<std::string>& names) {
  return ::testing::Combine(::testing::Values(Flavour::cpu, Flavour::gpu), ::testing::ValuesIn(names));
}

inline std::string vectors_name(const ::testing::TestParamInfo<VectorsTest::ParamType>& one) {
  std::string out = std::string(name_of(std::get<0>(one.param))) + "_" + std::get<1>(one.param);
  for (char& c : out)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return out;
}

}  // namespace vsplat::test

// Instantiates a suite for vectors that are made before all tests run, or only before slow tests.
#define VSPLAT_VECTORS(SUITE, NAMES) \
  INSTANTIATE_TEST_SUITE_P(Kernels, SUITE, ::vsplat::test::in_both_flavours(NAMES), ::vsplat::test::vectors_name)
#define VSPLAT_SLOW_VECTORS(SUITE, NAMES) \
  INSTANTIATE_TEST_SUITE_P(Slow, SUITE, ::vsplat::test::in_both_flavours(NAMES), ::vsplat::test::vectors_name)

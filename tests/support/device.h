// The device for tests: $VSPLAT_DEVICE, else the library's choice; one context per kernel flavour.
#pragma once
#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "runtime/context.h"

namespace vsplat::test {

// Ignores a table of tuned parameters on this machine, unless the test is run with one.
inline const int untuned = ::setenv("VSPLAT_TUNING", "off", 0);
// Uses all kernels, whatever a self-test has found.
inline const int unjudged = ::setenv("VSPLAT_SELFTEST", "ignore", 0);

// A separate context.
inline std::unique_ptr<Context> open_context(Flavour flavour, ContextOptions options = {}) {
  options.kernels = name_of(flavour);
  return std::make_unique<Context>(options);
}

// Closes the contexts after the tests, because the driver may be unloaded before them at exit.
class Contexts : public ::testing::Environment {
 public:
  void TearDown() override {
    for (auto& slot : slots) slot.reset();
  }
  static inline std::unique_ptr<Context> slots[2];
};
inline ::testing::Environment* const contexts = ::testing::AddGlobalTestEnvironment(new Contexts);

// One per flavour for the whole program, so that kernels compile once.
inline Context& context(Flavour flavour) {
  auto& slot = Contexts::slots[flavour == Flavour::gpu];
  if (!slot) slot = open_context(flavour);
  return *slot;
}

// TEST_P over both flavours: class MyOp : public FlavourTest {}; VSPLAT_FLAVOURS(MyOp);
class FlavourTest : public ::testing::TestWithParam<Flavour> {
 protected:
  Context& ctx() { return context(GetParam()); }
};

inline std::string flavour_name(const ::testing::TestParamInfo<Flavour>& info) { return name_of(info.param); }

}  // namespace vsplat::test

#define VSPLAT_FLAVOURS(fixture)                                                                                \
  INSTANTIATE_TEST_SUITE_P(Kernels, fixture, ::testing::Values(::vsplat::Flavour::cpu, ::vsplat::Flavour::gpu), \
                           ::vsplat::test::flavour_name)

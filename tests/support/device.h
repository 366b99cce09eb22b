// The device that tests run on: $VSPLAT_DEVICE, else what the library would choose; one context per kernel flavour.
#pragma once
#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "runtime/context.h"

namespace vsplat::test {

// Without a table of tuned parameters that this machine may have; one that a test is run with is taken.
inline const int untuned = ::setenv("VSPLAT_TUNING", "off", 0);
// And with all of its kernels, whatever a self-test has found.
inline const int unjudged = ::setenv("VSPLAT_SELFTEST", "ignore", 0);

// A context of its own.
inline std::unique_ptr<Context> open_context(Flavour flavour, ContextOptions options = {}) {
  options.kernels = name_of(flavour);
  return std::make_unique<Context>(options);
}

// Closes the contexts when the tests are over: at the program's exit the driver may be gone before them.
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

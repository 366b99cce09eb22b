// Holds an operation to its case of the self-test (model/diagnose/selftest/cases/STEM.cpp), at every size.
#pragma once
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "model/diagnose/selftest/cases/cases.h"
#include "tests/support/device.h"

namespace vsplat::test {

inline void expect_right(Context& ctx, const std::string& stem) {
  selftest::Checks checks(ctx, selftest::Sizes::all);
  for (const selftest::Case& one : selftest::cases_of(stem)) checks.run(one.name, one.run);
  EXPECT_FALSE(checks.findings().empty()) << "no case checks " << stem;
  std::map<std::string, bool> zeros;  // whether only zeros were expected
  for (std::size_t i = 0; i < checks.findings().size(); ++i) {
    const selftest::Finding& f = checks.findings()[i];
    EXPECT_TRUE(f.right) << f.what << ", result " << i << ": off by " << f.error << " of the largest, " << f.tolerance
                         << " allowed " << f.trouble;
    const auto [at, first] = zeros.try_emplace(f.what, f.zeros);
    if (!first) at->second = at->second && f.zeros;
  }
  for (const auto& [what, none] : zeros) EXPECT_FALSE(none) << what << ": all expected values are 0: nothing is tested";
}

}  // namespace vsplat::test

// Beside VSPLAT_FLAVOURS(fixture).
#define VSPLAT_OPERATION(fixture, stem) \
  TEST_P(fixture, MatchesItsCase) { ::vsplat::test::expect_right(ctx(), #stem); }

// The cases of a self-test: a file for each operation, cases/STEM.cpp. A case compares everything that its operation's
// header declares with scalar references in double, at sizes that provoke errors: 1, 3, 7, primes, a tile and one to
// either side of it. `vsplat selftest`, the tests and `vsplat bench` run the same cases. The files are listed in
// cmake/operations.cmake, basic operations first.
#pragma once
#include <string>
#include <vector>

#include "model/diagnose/selftest/checks.h"

namespace vsplat::selftest {

std::vector<Case> all_cases();
std::vector<Case> cases_of(const std::string& stem);  // those of one file; empty: there is no such file

}  // namespace vsplat::selftest

// At the end of cases/STEM.cpp: VSPLAT_CASES(STEM, {"name of a case", its function}, ...)
#define VSPLAT_CASES(stem, ...)     \
  std::vector<Case> stem##_cases(); \
  std::vector<Case> stem##_cases() { return {__VA_ARGS__}; }

// The self-test verdicts in the cache folder, for all devices: for callers that examine devices without opening them.
#pragma once
#include <string>
#include <vector>

#include "runtime/tuning/verdict.h"

namespace vsplat {

struct StoredVerdict {
  std::string device, driver;  // as the driver reports them
  Verdict verdict;
};

// The verdicts on the current kernels and the current value of VSPLAT_LIMITS.
std::vector<StoredVerdict> stored_verdicts();

}  // namespace vsplat

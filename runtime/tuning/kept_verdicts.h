// What self-tests have left in the cache's folder, of whatever device: for who looks at devices and opens none.
#pragma once
#include <string>
#include <vector>

#include "runtime/tuning/verdict.h"

namespace vsplat {

struct KeptVerdict {
  std::string device, driver;  // as the driver tells them
  Verdict verdict;
};

// Of these kernels, with what VSPLAT_LIMITS says now.
std::vector<KeptVerdict> kept_verdicts();

}  // namespace vsplat

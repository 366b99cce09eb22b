#pragma once
#include <vector>

#include "model/api/handle.h"
#include "runtime/context.h"

namespace vsplat::api {

// Runs a plan; false where a single buffer is larger than the device allows (the plan ends there).
template <class F>
bool fits_within(const F& plan) {
  try {
    plan();
    return true;
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    return false;
  }
}

// `limit`: bytes that may be used. `fits`: whether every buffer is small enough; the sum is looked at here.
vsplat_plan plan_of(const std::vector<StageMemory>& stages, std::size_t peak, std::size_t limit, bool fits);

}  // namespace vsplat::api

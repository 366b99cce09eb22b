#pragma once
#include <vector>

#include "model/api/handle.h"
#include "runtime/context.h"

namespace vsplat::api {

// Runs a plan; returns false if a single buffer exceeds the device's limit, which ends the plan.
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

// Compares what `ctx` may use with `peak` bytes of device memory and `host` bytes in addition. `fits`: every buffer is
// within the device's limit.
vsplat_plan plan_of(const Context& ctx, const std::vector<StageMemory>& stages, std::size_t peak, bool fits,
                    double host = 0);

}  // namespace vsplat::api

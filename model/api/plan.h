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

// What `ctx` may use, held against `peak`, bytes of its memory, and `host` bytes beside them. `fits`: whether every
// buffer is small enough.
vsplat_plan plan_of(const Context& ctx, const std::vector<StageMemory>& stages, std::size_t peak, bool fits,
                    double host = 0);

}  // namespace vsplat::api

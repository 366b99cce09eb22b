// Reserves exactly the memory that work needs, before it runs.
#pragma once
#include <functional>

#include "runtime/context.h"

namespace vsplat {

// Runs `work` on a planning context, then reserves the memory that the plan used. Frees unused memory if that helps.
// Returns false, with nothing reserved, if the work would exceed the memory limit.
bool reserve_for(Context& ctx, const std::function<void(Context&)>& work);

}  // namespace vsplat

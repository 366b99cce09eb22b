// Memory made to measure before the work that needs it.
#pragma once
#include <functional>

#include "runtime/context.h"

namespace vsplat {

// Runs `work` on a plan, then makes the memory that it came to need. Memory that nothing lives in is given up where
// that helps. False where it would be more than may be used: nothing has changed then.
bool make_room(Context& ctx, const std::function<void(Context&)>& work);

}  // namespace vsplat

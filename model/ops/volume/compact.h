// Converts flags to the list of those that are set.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// Ascending indices, i32 [P], of the flags (u32 [n], each 0 or 1) that are 1. Reads P back, and so waits for the queue.
// A planner, which cannot read, uses `planned` as P.
Tensor compact(Context& ctx, const Tensor& flags, long planned);

}  // namespace vsplat

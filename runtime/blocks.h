// Work that is done block by block.
#pragma once
#include <vector>

#include "runtime/context.h"

namespace vsplat {

// The first indices of the blocks of `block` elements that cover `count` elements. Every block allocates the same
// memory and frees it, so a planner runs only the first blocks and the last.
std::vector<long> block_starts(const Context& ctx, long count, long block);

}  // namespace vsplat

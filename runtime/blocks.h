// What is done block by block.
#pragma once
#include <vector>

#include "runtime/context.h"

namespace vsplat {

// Where the blocks of `block` begin that make up `count`. Every block takes the same memory and gives it back, so a
// plan goes through the first ones and the last alone.
std::vector<long> block_starts(const Context& ctx, long count, long block);

}  // namespace vsplat

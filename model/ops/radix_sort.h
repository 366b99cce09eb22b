// Stable sort of keys with 32-bit values on the device.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct Sorted {
  Tensor keys;    // u32 or u64 [n], ascending by their low `bits` bits
  Tensor values;  // u32 [n]
};

// keys u32 or u64 [n], values u32 [n] or none (0, 1, 2, ...); n < 2^31. Looks at the low `bits` bits of the keys only;
// equal ones keep their order. Both inputs are used as scratch. Cost: about 2 bits / 8 passes over the keys (cpu), 2
// bits / 4 (gpu).
Sorted radix_sort(Context& ctx, Tensor keys, Tensor values, int bits);

}  // namespace vsplat

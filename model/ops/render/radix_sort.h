// Stable sort of keys with 32-bit values on the device.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct Sorted {
  Tensor keys;    // u32 or u64 [n], ascending by their low `bits` bits
  Tensor values;  // u32 [n]
};

// keys u32 or u64 [n], values u32 [n] or none (0, 1, 2, ...); n < 2^31. Sorts by the low `bits` bits of the keys; equal
// ones keep their order. Overwrites both inputs. Makes about bits / 4 passes over the keys in the cpu flavour, bits / 2
// in the gpu flavour.
Sorted radix_sort(Context& ctx, Tensor keys, Tensor values, int bits);

}  // namespace vsplat

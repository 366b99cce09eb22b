// Prefix sums on the device.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// out[i] = in[0] + ... + in[i-1], for in u32 [n] and out u32 [n + 1], whose last element is the total (modulo 2^32). n
// from 0 to 2^31. `in` and `out` must not share memory.
void exclusive_scan(Context& ctx, const Tensor& in, const Tensor& out);

}  // namespace vsplat

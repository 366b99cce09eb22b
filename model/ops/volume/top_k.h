// The k largest numbers.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct TopK {
  Tensor x;       // f32 [n]
  long k = 0;     // number of flags to set; if at least n, all of them
  Tensor flags;   // u32 [n], written: 1 for each of the k largest; of equal ones the first
  Tensor others;  // u32 [n], written: 1 - flags; or none
};
void top_k(Context& ctx, const TopK& a);

}  // namespace vsplat

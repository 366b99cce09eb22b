// Transposes a matrix: converts volumes from channels first, as PyTorch stores them, to channels last and back.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct Transpose {
  Tensor x;    // [A, B]
  Tensor out;  // [B, A], not x: written, or with `add` added to
  bool add = false;
};
void transpose(Context& ctx, const Transpose& a);

}  // namespace vsplat

// Rotary position embedding: rotates queries and keys by angles that depend on the tokens' places in a grid.
#pragma once
#include <vector>

#include "runtime/context.h"

namespace vsplat {

// Cosine and sine of the angles of an h x w grid, row by row: [h w, D/2, 2] for heads of D, a multiple of 4. A patch's
// centre is at y = 2 (row + 1/2)/h - 1, x likewise; angle j is 2 pi y / period j for j < D/4, then 2 pi x / period j -
// D/4; periods are base^(4 i / D), rounded to bfloat16 on request.
std::vector<float> rope_turns(long h, long w, long head, double base, bool bf16);

struct RopeForward {
  Tensor qkv;    // [V, T, 3, H, D]: q and k of the last tokens, as many as `turns` has, are rotated in place
  Tensor turns;  // [T - P, D/2, 2]
};
void rope_forward(Context& ctx, const RopeForward& a);

struct RopeBackward {
  Tensor dqkv;   // [V, T, 3, H, D]: in place; in: gradients by the rotated q and k, out: by the original ones
  Tensor turns;  // as in the forward
};
void rope_backward(Context& ctx, const RopeBackward& a);

}  // namespace vsplat

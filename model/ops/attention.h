// Multi-head self-attention: out = softmax(Q K^T / sqrt(D)) V for every view and head, without a T x T matrix.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct AttentionForward {
  Tensor qkv;  // [V, T, 3, H, D]: what one Linear makes of the tokens
  Tensor out;  // [V, T, H * D]
};

// The cpu flavour takes scratch of about two thirds of qkv's size.
void attention_forward(Context& ctx, const AttentionForward& a);

}  // namespace vsplat

// Multi-head self-attention: out = softmax(Q K^T / sqrt(D)) V for every view and head, without a T x T matrix.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct AttentionForward {
  Tensor qkv;    // [V, T, 3, H, D]: what one Linear makes of the tokens
  Tensor out;    // [V, T, H * D]
  Tensor stats;  // [V, H, T, 2] or none: what the backward needs of each query's softmax
};

// The cpu flavour takes scratch of about two thirds of qkv's size.
void attention_forward(Context& ctx, const AttentionForward& a);

struct AttentionBackward {
  Tensor qkv, out, stats;  // as forward had and left them
  Tensor dout;             // [V, T, H * D]: the loss by forward's out
  Tensor dqkv;             // [V, T, 3, H, D]; written
};

// The cpu flavour takes scratch of about two and a half times qkv's size.
void attention_backward(Context& ctx, const AttentionBackward& a);

}  // namespace vsplat

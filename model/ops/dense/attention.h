// Multi-head self-attention: out = softmax(Q K^T / sqrt(D)) V for every view and head, without a T x T matrix.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct AttentionForward {
  Tensor qkv;    // [V, T, 3, H, D]: queries, keys and values from one Linear
  Tensor out;    // [V, T, H * D]
  Tensor stats;  // [V, H, T, 2] or none: statistics of each query's softmax, for the backward
};

// The cpu flavour uses scratch memory of about two thirds of qkv's size.
void attention_forward(Context& ctx, const AttentionForward& a);

struct AttentionBackward {
  Tensor qkv, out, stats;  // the forward's
  Tensor dout;             // [V, T, H * D]: gradient by the forward's out
  Tensor dqkv;             // [V, T, 3, H, D]; written
};

// The cpu flavour uses scratch memory of about two and a half times qkv's size.
void attention_backward(Context& ctx, const AttentionBackward& a);

}  // namespace vsplat

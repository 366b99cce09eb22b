// Multi-head attention in groups of a few queries and a few keys: out = softmax(Q K^T / sqrt(D)) V inside each group.
// For many tokens that all look at each other see attention.h.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// Who looks at whom. Every query is in one group, and every key in as many as `places` says.
struct AttentionGroups {
  Tensor queries;  // i32 [G, L]: each group's rows of q; none: L rows after the other
  Tensor keys;     // i32 [G, S]: each group's rows of k and v; none: S rows after the other
  long l = 1;      // L, where `queries` is none
  long s = 1;      // S, where `keys` is none
  // i32 [N, B]: of each row of k its places in `keys`, counted over all groups; none: each is in one group.
  Tensor places = {};
  // i32 [G, L] and [G, S], both or none: parts of a picture. Of queries and keys of different parts 100 is taken from
  // the score.
  Tensor query_parts = {}, key_parts = {};
};

struct CrossAttentionForward {
  Tensor q;     // [Q, H D]
  Tensor k, v;  // [N, H D]
  long heads = 1;
  AttentionGroups groups;
  Tensor out;    // [Q, H D]
  Tensor stats;  // [Q, H] or none: what the backward needs of each query's softmax
};
void cross_attention_forward(Context& ctx, const CrossAttentionForward& a);

struct CrossAttentionBackward {
  Tensor q, k, v;  // as forward had them
  long heads = 1;
  AttentionGroups groups;
  Tensor out, stats;  // as forward left them
  Tensor dout;        // [Q, H D]: the loss by forward's out
  Tensor dq;          // [Q, H D]; written
  Tensor dk, dv;      // [N, H D]; written
};
void cross_attention_backward(Context& ctx, const CrossAttentionBackward& a);

}  // namespace vsplat

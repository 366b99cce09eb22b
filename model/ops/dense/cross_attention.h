// Multi-head attention in groups of a few queries and a few keys: out = softmax(Q K^T / sqrt(D)) V inside each group.
// For many tokens that all attend to each other see attention.h.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// Which queries attend to which keys. Every query is in one group; a key may be in several, as `places` lists.
struct AttentionGroups {
  Tensor queries;  // i32 [G, L]: each group's rows of q; none: consecutive runs of L rows
  Tensor keys;     // i32 [G, S]: each group's rows of k and v; none: consecutive runs of S rows
  long l = 1;      // L, if `queries` is none
  long s = 1;      // S, if `keys` is none
  // i32 [N, B]: for each row of k its places in `keys`, counted over all groups; none: each is in one group.
  Tensor places = {};
  // i32 [G, L] and [G, S], both or none: parts of a picture. Scores between different parts are lowered by 100.
  Tensor query_parts = {}, key_parts = {};
};

struct CrossAttentionForward {
  Tensor q;     // [Q, H D]
  Tensor k, v;  // [N, H D]
  long heads = 1;
  AttentionGroups groups;
  Tensor out;    // [Q, H D]
  Tensor stats;  // [Q, H] or none: statistics of each query's softmax, for the backward
};
void cross_attention_forward(Context& ctx, const CrossAttentionForward& a);

struct CrossAttentionBackward {
  Tensor q, k, v;  // as in the forward
  long heads = 1;
  AttentionGroups groups;
  Tensor out, stats;  // as the forward wrote them
  Tensor dout;        // [Q, H D]: gradient by the forward's out
  Tensor dq;          // [Q, H D]; written
  Tensor dk, dv;      // [N, H D]; written
};
void cross_attention_backward(Context& ctx, const CrossAttentionBackward& a);

}  // namespace vsplat

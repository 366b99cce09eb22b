// A transformer block with attention between all tokens, used by the image encoder and the ray predictor.
#pragma once
#include "model/networks/layers/upload_weights.h"

namespace vsplat {

struct BlockOptions {
  int heads = 1;
  float eps = 1e-6f;
  Activation activation = Activation::gelu;  // of the MLP
  Tensor turns;                              // rotations of queries and keys, see model/ops/dense/rope.h; empty: none
};

// What backward needs from a forward; norms and the MLP's activation are recomputed. 10 values a token and channel.
struct BlockSaved {
  Tensor x;                     // [V, T, C], the block's input
  Tensor qkv, attended, stats;  // see model/ops/dense/attention.h; after rotation, if there is one
  Tensor middle;                // [V, T, C], between attention and MLP
  Tensor hidden;                // [V T, 4 C], before the activation
};

// y = x + attention(norm1(x)), then y + mlp(norm2(y)), over the T tokens of each of V sequences. Works in x's memory if
// nothing is stored.
Tensor block_forward(Context& ctx, const TransformerBlock<WeightLoader>& layers, const BlockOptions& options,
                     const Tensor& x, BlockSaved* saved = nullptr);
// dx [V T, C]: gradient by the block's result on entry, by its input on return. Adds to the gradients of the weights.
void block_backward(Context& ctx, const TransformerBlock<WeightLoader>& layers, const BlockOptions& options,
                    const BlockSaved& saved, const Tensor& dx);

}  // namespace vsplat

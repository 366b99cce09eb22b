// A block of a transformer whose tokens all look at each other: of the image encoder, and of what predicts rays.
#pragma once
#include "model/networks/layers/upload_weights.h"

namespace vsplat {

struct BlockOptions {
  int heads = 1;
  float eps = 1e-6f;
  Activation activation = Activation::gelu;  // of the MLP
  Tensor turns;  // of queries and keys, see model/ops/dense/rope.h; none: they are not turned
};

// What the backward wants of a forward; norms and the MLP's activation it makes again. 10 values a token and channel.
struct BlockSaved {
  Tensor x;                     // [V, T, C], the block's input
  Tensor qkv, attended, stats;  // see model/ops/dense/attention.h; turned, where they are
  Tensor middle;                // [V, T, C], between attention and MLP
  Tensor hidden;                // [V T, 4 C], before the activation
};

// y = x + attention(norm1(x)), then y + mlp(norm2(y)): of the T tokens of each of V. In x's memory where nothing is
// saved.
Tensor block_forward(Context& ctx, const TransformerBlock<WeightLoader>& layers, const BlockOptions& options,
                     const Tensor& x, BlockSaved* saved = nullptr);
// dx [V T, C]: by the block's result before, by its input after. Adds to the gradients by the weights.
void block_backward(Context& ctx, const TransformerBlock<WeightLoader>& layers, const BlockOptions& options,
                    const BlockSaved& saved, const Tensor& dx);

}  // namespace vsplat

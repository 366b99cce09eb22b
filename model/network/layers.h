// The layers that the stages are made of, and what several of them do with those. Backwards add to the gradients by
// weights, which are there in training only (see LearntWeights). Layers are made by WeightLoader.
#pragma once
#include "model/ops/conv3d.h"
#include "runtime/gemm.h"

namespace vsplat {

// The rows of x, or of SiLU(x).
RowSource rows_of(const Tensor& x, bool silu = false);

// A Linear, a 1x1x1 convolution or a convolution of patches.
struct Linear {
  PackedMatrix w;
  Tensor bias;
  Tensor plain, dweight, dbias;  // in training: [out, in], and the gradients
};
Tensor linear_forward(Context& ctx, const Linear& layer, const RowSource& in, const char* name,
                      Activation activation = Activation::none);

// The backward of linear_forward() without an activation. `in` as the forward had it, without a map.
struct LinearBackward {
  RowSource in;
  Tensor dy;  // [rows, out]
  // By the input as composed, after scale, shift and SiLU: none where not wanted; written, or with `add` added to.
  Tensor dx0;  // [rows, C0 + C1], or [rows, C0] where dx1 is there
  Tensor dx1;  // [rows, C1]
  bool add = false;
  const char* name = "linear";  // its rows in the profile
};
void linear_backward(Context& ctx, const Linear& layer, const LinearBackward& b);

// See model/ops/layernorm.h.
struct LayerNorm {
  Tensor gamma, beta;
  Tensor dgamma, dbeta;  // in training
};

struct GroupNorm {
  Tensor gamma, beta;
  int groups = 1;
  Tensor dgamma, dbeta;  // in training
};
struct NormSaved {
  RowSource rows;     // what norm_silu_forward() gave
  Tensor mean, rstd;  // [C]
};
// SiLU(GroupNorm([x0, x1])), to be made by whoever loads it. Computes the statistics over all rows. What `saved` holds
// is for the backward.
RowSource norm_silu_forward(Context& ctx, const GroupNorm& norm, const Tensor& x0, const Tensor& x1 = {},
                            NormSaved* saved = nullptr);
// dy [rows, C0 + C1] by the composed rows -> dx0, dx1 by the inputs: written, or with `add` added to. dx0 may be dy
// where there is no x1.
void norm_silu_backward(Context& ctx, const GroupNorm& norm, const NormSaved& saved, const Tensor& dy,
                        const Tensor& dx0, const Tensor& dx1 = {}, bool add = false);

// A Linear on channels of two kinds, each of which is multiplied apart.
struct SplitLinear {
  PackedMatrix first, rest;
  Tensor bias;
  Tensor plain, dweight, dbias;  // in training: [out, in], and the gradients
};

// A convolution's weights. In training: as PyTorch has them, and the gradients by them and the bias.
struct Conv {
  ConvWeights w;
  Tensor plain, dweight, dbias;
};

// The encoder's position embedding, resampled to the grid of its tokens, with the class token.
struct Positions {
  int from = 0, to = 0;          // g, t
  Tensor resampled;              // [1 + t t, C], the class token added to its own
  Tensor dstored, dclass_token;  // in training, by what is stored: [1 + g g, C], [C]
};

// Three linear layers with SiLU between them.
struct Mlp3 {
  Linear first, second, third;
};
struct Mlp3Saved {
  Tensor x, h1, h2;  // input, and the hidden rows before their SiLU
};
Tensor mlp3_forward(Context& ctx, const Mlp3& mlp, const Tensor& x, const char* name, Mlp3Saved* saved = nullptr);
// dy [rows, out] -> dx [rows, in]: written, or with `add` added to.
void mlp3_backward(Context& ctx, const Mlp3& mlp, const Mlp3Saved& saved, const Tensor& dy, const Tensor& dx, bool add,
                   const char* name);

}  // namespace vsplat

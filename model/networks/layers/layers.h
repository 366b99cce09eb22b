// The layers that the stages are made of, and what several of them do with those. Backwards add to the gradients by
// weights, which are there in training only (see LearntWeights). Layers are made by WeightLoader.
#pragma once
#include <vector>

#include "model/ops/dense/conv3d.h"
#include "runtime/gemm.h"

namespace vsplat {

// The rows of x, or of SiLU(x).
RowSource rows_of(const Tensor& x, bool silu = false);

// What is learnt as it is, and in training the gradient by it.
struct Learnt {
  Tensor value, gradient;
};

// A Linear, a 1x1x1 convolution or a convolution of patches.
struct Linear {
  PackedMatrix w;
  Tensor bias;                   // may be none
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

// x [.., C] as [rows, C].
Tensor flat(const Tensor& x);

// out = x + linear(in); out may be x.
void add_linear(Context& ctx, const Linear& linear, const Tensor& in, const Tensor& x, const Tensor& out,
                const char* name);

// See model/ops/dense/layernorm.h.
struct LayerNorm {
  Tensor gamma, beta;
  Tensor dgamma, dbeta;  // in training
};
// x [.., C] -> [rows, C]
Tensor normed_forward(Context& ctx, const LayerNorm& norm, const Tensor& x, float eps, const char* what);
// dx += what comes back through the norm of x; without `add` dx is written.
void normed_backward(Context& ctx, const LayerNorm& norm, const Tensor& x, float eps, const Tensor& dy,
                     const Tensor& dx, bool add = true);

// fc2(GELU(fc1(norm(x)))), the second half of a transformer's block.
struct GeluMlp {
  const LayerNorm& norm;
  const Linear &fc1, &fc2;
  float eps;
  Activation activation = Activation::gelu;  // or its approximation by tanh
};
// out = x + MLP(x); out may be x where nothing is kept. `hidden` [rows, fc1.out] before GELU, for the backward, or
// null.
void gelu_mlp_forward(Context& ctx, const GeluMlp& mlp, const Tensor& x, const Tensor& out, Tensor* hidden = nullptr);
// dx: by the output before, by x after.
void gelu_mlp_backward(Context& ctx, const GeluMlp& mlp, const Tensor& x, const Tensor& hidden, const Tensor& dx);

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

// A Linear whose outputs are multiplied by a learnt scale, folded into its weights.
struct ScaledLinear {
  Linear folded;        // in training with `plain`, and gradients only where there is no scale
  Tensor scale;         // [out], or none: then `folded` is all
  Tensor weight, bias;  // in training, as they are stored
  Tensor dweight, dbias, dscale;
};
// What a scaled layer's backward goes through: the folded layer with gradients of its own, which start as zeros; add()
// makes the stored ones' of them.
class FoldedGradients {
 public:
  FoldedGradients(Context& ctx, const ScaledLinear& layer);
  const Linear& linear() const { return linear_; }
  void add(Context& ctx) const;

 private:
  const ScaledLinear& layer_;
  Linear linear_;
};

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

// 3x3x3 at edge^3 voxels; `residual` and `out` may be none, a new tensor then.
Tensor volume_conv_forward(Context& ctx, const Conv& conv, const RowSource& in, long edge, const char* name,
                           const Tensor& residual = {}, const Tensor& out = {});
// -> by the composed rows of `in`.
Tensor volume_conv_backward(Context& ctx, const Conv& conv, const RowSource& in, const Tensor& dy, long edge,
                            const char* name);

// A transposed convolution 2x2x2, see model/ops/dense/conv3d_up.h.
struct ConvUp {
  PackedMatrix w;
  Tensor bias;
  Tensor plain, dweight, dbias;  // in training: [in, out, 2, 2, 2], and the gradients
};

// The encoder's position embedding, resampled to the grid of its tokens, with the class token.
struct Positions {
  int from = 0, to = 0;          // g, t
  Tensor resampled;              // [1 + t t, C], the class token added to its own
  Tensor dstored, dclass_token;  // in training, by what is stored: [1 + g g, C], [C]
};

// Linear layers with ReLU between them. `saved`: what each was given, for the backward, or null.
Tensor relu_mlp_forward(Context& ctx, const std::vector<Linear>& mlp, const Tensor& x, const char* name,
                        std::vector<Tensor>* saved = nullptr);
// dy [rows, out] -> dx [rows, in]: written, or with `add` added to.
void relu_mlp_backward(Context& ctx, const std::vector<Linear>& mlp, const std::vector<Tensor>& saved, const Tensor& dy,
                       const Tensor& dx, bool add, const char* name);

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

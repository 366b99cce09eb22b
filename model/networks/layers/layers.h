// Layers of the stages, and operations that several stages share. Backward functions add to the gradients of weights,
// which exist only in training (see LearntWeights). WeightLoader makes the layers.
#pragma once
#include <vector>

#include "model/ops/dense/conv3d.h"
#include "runtime/gemm.h"

namespace vsplat {

// The rows of x, or of SiLU(x).
RowSource rows_of(const Tensor& x, bool silu = false);

// A tensor that is itself a parameter, and in training its gradient.
struct Learnt {
  Tensor value, gradient;
};

// A Linear, a 1x1x1 convolution or a convolution of patches.
struct Linear {
  PackedMatrix w;
  Tensor bias;                   // may be empty
  Tensor plain, dweight, dbias;  // in training: [out, in], and the gradients
};
Tensor linear_forward(Context& ctx, const Linear& layer, const RowSource& in, const char* name,
                      Activation activation = Activation::none);

// The backward of linear_forward() without an activation. `in` as in the forward, without a map.
struct LinearBackward {
  RowSource in;
  Tensor dy;  // [rows, out]
  // Gradients by the composed input, after scale, shift and SiLU. Empty if not needed; overwritten, or added to if
  // `add` is set.
  Tensor dx0;  // [rows, C0 + C1], or [rows, C0] if dx1 is given
  Tensor dx1;  // [rows, C1]
  bool add = false;
  const char* name = "linear";  // label in the profile
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
// Adds the gradient through the norm of x to dx; without `add`, overwrites dx.
void normed_backward(Context& ctx, const LayerNorm& norm, const Tensor& x, float eps, const Tensor& dy,
                     const Tensor& dx, bool add = true);

// fc2(GELU(fc1(norm(x)))), the second half of a transformer's block.
struct GeluMlp {
  const LayerNorm& norm;
  const Linear &fc1, &fc2;
  float eps;
  Activation activation = Activation::gelu;  // or its approximation by tanh
};
// out = x + MLP(x); out may be x if nothing is stored. `hidden`: receives the values [rows, fc1.out] before GELU for
// the backward, or null.
void gelu_mlp_forward(Context& ctx, const GeluMlp& mlp, const Tensor& x, const Tensor& out, Tensor* hidden = nullptr);
// dx: gradient by the output on entry, by x on return.
void gelu_mlp_backward(Context& ctx, const GeluMlp& mlp, const Tensor& x, const Tensor& hidden, const Tensor& dx);

struct GroupNorm {
  Tensor gamma, beta;
  int groups = 1;
  Tensor dgamma, dbeta;  // in training
};
struct NormSaved {
  RowSource rows;     // result of norm_silu_forward()
  Tensor mean, rstd;  // [C]
};
// SiLU(GroupNorm([x0, x1])), evaluated by the kernel that loads the rows. Computes the statistics over all rows.
// `saved`: receives what the backward needs.
RowSource norm_silu_forward(Context& ctx, const GroupNorm& norm, const Tensor& x0, const Tensor& x1 = {},
                            NormSaved* saved = nullptr);
// dy [rows, C0 + C1] by the composed rows -> dx0, dx1 by the inputs: overwritten, or added to if `add` is set. dx0 may
// be dy if there is no x1.
void norm_silu_backward(Context& ctx, const GroupNorm& norm, const NormSaved& saved, const Tensor& dy,
                        const Tensor& dx0, const Tensor& dx1 = {}, bool add = false);

// A Linear whose outputs are multiplied by a learnt scale, which is folded into its weights.
struct ScaledLinear {
  Linear folded;        // in training with `plain`, and with gradients only if there is no scale
  Tensor scale;         // [out]; empty: `folded` is the whole layer
  Tensor weight, bias;  // in training, as stored
  Tensor dweight, dbias, dscale;
};
// Backward of a scaled layer: gradients of the folded layer, which start as zeros. add() converts them to gradients of
// the stored parameters.
class FoldedGradients {
 public:
  FoldedGradients(Context& ctx, const ScaledLinear& layer);
  const Linear& linear() const { return linear_; }
  void add(Context& ctx) const;

 private:
  const ScaledLinear& layer_;
  Linear linear_;
};

// A Linear whose input has two groups of channels, each with its own matrix.
struct SplitLinear {
  PackedMatrix first, rest;
  Tensor bias;
  Tensor plain, dweight, dbias;  // in training: [out, in], and the gradients
};

// A convolution's weights. In training also in PyTorch's layout, with the gradients of weights and bias.
struct Conv {
  ConvWeights w;
  Tensor plain, dweight, dbias;
};

// 3x3x3 at edge^3 voxels. `residual` may be empty; if `out` is empty, a new tensor is made.
Tensor volume_conv_forward(Context& ctx, const Conv& conv, const RowSource& in, long edge, const char* name,
                           const Tensor& residual = {}, const Tensor& out = {});
// Returns the gradient by the composed rows of `in`.
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
  Tensor resampled;              // [1 + t t, C], with the class token added to the first row
  Tensor dstored, dclass_token;  // in training, by the stored values: [1 + g g, C], [C]
};

// Linear layers with ReLU between them. `saved`: receives each layer's input for the backward, or null.
Tensor relu_mlp_forward(Context& ctx, const std::vector<Linear>& mlp, const Tensor& x, const char* name,
                        std::vector<Tensor>* saved = nullptr);
// dy [rows, out] -> dx [rows, in]: overwritten, or added to if `add` is set.
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
// dy [rows, out] -> dx [rows, in]: overwritten, or added to if `add` is set.
void mlp3_backward(Context& ctx, const Mlp3& mlp, const Mlp3Saved& saved, const Tensor& dy, const Tensor& dx, bool add,
                   const char* name);

}  // namespace vsplat

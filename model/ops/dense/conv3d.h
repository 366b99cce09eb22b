// Convolutions of channels-last volumes [X, Y, Z, C] (x slowest). A 1x1x1 convolution is a plain gemm(); for
// convolutions of active voxels see sparse_conv.h.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

struct ConvWeights {
  PackedMatrix w;
  Tensor bias;  // [Cout] or none
  long cin = 0, cout = 0;
  bool winograd = false;
};

// The method of a dense 3x3x3 convolution. winograd needs a quarter of the direct sum's multiplications, for four times
// the weights' memory and three times the rounding error (some 4e-6 of the largest value). In the gpu flavour its
// transformed data goes through memory, and the gradient by weights is a direct sum.
enum class ConvMethod : int { auto_ = 0, direct = 1, winograd = 2 };

// Repacks 3x3x3 weights in PyTorch's layout, w [Cout][Cin][3][3][3] (x, y, z), for conv3d_forward(). bias [Cout] or
// null. auto_: winograd, unless the convolution is too small to profit.
ConvWeights pack_conv3d(Context& ctx, const float* w, const float* bias, long cout, long cin, const std::string& what,
                        ConvMethod method = ConvMethod::auto_);
// The same from device memory, for weights that training changes. w [Cout, Cin, 3, 3, 3]; bias [Cout] or none.
ConvWeights pack_conv3d(Context& ctx, const Tensor& w, const Tensor& bias, const std::string& what,
                        ConvMethod method = ConvMethod::auto_);
// Repacks 2x2x2 weights, w [Cout][Cin][2][2][2], for conv3d_down_forward(). bias [Cout] or null.
ConvWeights pack_conv3d_down(Context& ctx, const float* w, const float* bias, long cout, long cin,
                             const std::string& what);
// The same from device memory. w [Cout, Cin, 2, 2, 2]; bias [Cout] or none.
ConvWeights pack_conv3d_down(Context& ctx, const Tensor& w, const Tensor& bias, const std::string& what);
// out = conv3x3x3(in, zero padding 1) + bias + residual.
struct Conv3dForward {
  RowSource in;  // x0 [X Y Z, C0], x1, scale, shift, silu; no map. The padding is zero after composing.
  long x = 0, y = 0, z = 0;
  const ConvWeights* weights = nullptr;
  Tensor residual;  // [X Y Z, Cout] or none; may be `out`, but no input may
  Tensor out;       // [X Y Z, Cout]
  const char* name = "conv3d";
};
void conv3d_forward(Context& ctx, const Conv3dForward& c);

// A convolution's gradients take two calls, so that the first call's scratch memory is free when the second makes dx.
// This is the first: gradients by conv3d_forward()'s weights and biases, from dy, the gradient by its outputs. Sums
// have a fixed order, and so the same bits each time.
struct Conv3dBackwardWeights {
  RowSource in;  // as for conv3d_forward()
  long x = 0, y = 0, z = 0;
  Tensor dy;     // [X Y Z, Cout]
  Tensor dw;     // [Cout, Cin, 3, 3, 3], added to
  Tensor dbias;  // [Cout] or none, added to
  ConvMethod method = ConvMethod::auto_;
  const char* name = "conv3d.dw";
};
void conv3d_backward_weights(Context& ctx, const Conv3dBackwardWeights& g);

// The second call: the gradient by conv3d_forward()'s inputs after composing (scale, shift and SiLU).
struct Conv3dBackwardInputs {
  Tensor w;  // [Cout, Cin, 3, 3, 3]
  long x = 0, y = 0, z = 0;
  Tensor dy;  // [X Y Z, Cout]
  Tensor dx;  // [X Y Z, Cin], written
  ConvMethod method = ConvMethod::auto_;
  const char* name = "conv3d.dx";
};
void conv3d_backward_inputs(Context& ctx, const Conv3dBackwardInputs& g);

// Floating-point operations of conv3d_forward()'s products: of the direct sum, or the fewer of Winograd's method.
double conv3d_flops(const ConvWeights& weights, long x, long y, long z);

// The 2x2x2 neighbourhoods for a stride of 2: i32 [X/2 Y/2 Z/2, 8], for gemm(). An odd last plane is ignored.
Tensor conv3d_down_map(Context& ctx, long x, long y, long z);

// out = conv2x2x2(in, stride 2) + bias.
struct Conv3dDownForward {
  RowSource in;  // x0 [X Y Z, C0], x1, scale, shift, silu; map = conv3d_down_map()
  const ConvWeights* weights = nullptr;
  Tensor out;  // [X/2 Y/2 Z/2, Cout]
  const char* name = "conv3d_down";
};
void conv3d_down_forward(Context& ctx, const Conv3dDownForward& c);

// Gradients by conv3d_down_forward()'s inputs, weights and biases, from dy, the gradient by its outputs. The same bits
// each time.
struct Conv3dDownBackward {
  RowSource in;  // as for conv3d_down_forward()
  Tensor w;      // [Cout, Cin, 2, 2, 2]
  Tensor dy;     // [X/2 Y/2 Z/2, Cout]
  Tensor dx;     // [X Y Z, Cin] or none, added to: by the composed inputs
  Tensor dw;     // [Cout, Cin, 2, 2, 2], added to
  Tensor dbias;  // [Cout] or none, added to
};
void conv3d_down_backward(Context& ctx, const Conv3dDownBackward& g);

}  // namespace vsplat

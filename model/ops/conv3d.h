// Convolutions of channels-last volumes [X, Y, Z, C] (x slowest), and the weights of sparse ones.
// A 1x1x1 convolution is gemm() alone; so is a submanifold convolution, with pack_submanifold() and a neighbour map.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

struct ConvWeights {
  PackedMatrix w;
  Tensor bias;  // [Cout] or none
  long cin = 0, cout = 0;
};

// 3x3x3 weights as PyTorch has them, w [Cout][Cin][3][3][3] (x, y, z), repacked for conv3d(). bias [Cout] or null.
ConvWeights pack_conv3d(Context& ctx, const float* w, const float* bias, long cout, long cin, const std::string& what);
// 2x2x2 weights, w [Cout][Cin][2][2][2], for conv3d_down(). bias [Cout] or null.
ConvWeights pack_conv3d_down(Context& ctx, const float* w, const float* bias, long cout, long cin,
                             const std::string& what);
// Submanifold weights w [Cout][kx][ky][kz][Cin] with `taps` = kx ky kz, for gemm() with a map [P, taps] (or none where
// taps is 1). bias [Cout] or null.
ConvWeights pack_submanifold(Context& ctx, const float* w, const float* bias, long cout, long taps, long cin,
                             const std::string& what);
// Bytes that the weights of a dense or sparse convolution with `taps` taps take on the device, without the bias.
std::size_t packed_conv_bytes(Flavour flavour, long cout, long taps, long cin);

// out = conv3x3x3(in, zero padding 1) + bias + residual.
struct Conv3d {
  RowSource in;  // x0 [X Y Z, C0], x1, scale, shift, silu; no map. The padding is zero after all of it.
  long x = 0, y = 0, z = 0;
  const ConvWeights* weights = nullptr;
  Tensor residual;  // [X Y Z, Cout] or none; may be `out`, but no input may
  Tensor out;       // [X Y Z, Cout]
  const char* name = "conv3d";
};
void conv3d(Context& ctx, const Conv3d& c);

// The 2x2x2 neighbourhoods of a stride of 2: i32 [X/2 Y/2 Z/2, 8], for gemm(). An odd last plane is not looked at.
Tensor conv3d_down_map(Context& ctx, long x, long y, long z);

// out = conv2x2x2(in, stride 2) + bias.
struct Conv3dDown {
  RowSource in;  // x0 [X Y Z, C0], x1, scale, shift, silu; map = conv3d_down_map()
  const ConvWeights* weights = nullptr;
  Tensor out;  // [X/2 Y/2 Z/2, Cout]
  const char* name = "conv3d_down";
};
void conv3d_down(Context& ctx, const Conv3dDown& c);

}  // namespace vsplat

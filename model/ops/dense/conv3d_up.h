// Transposed convolution 2x2x2 with stride 2 of channels-last volumes: twice as many voxels along each axis.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

// Repacks w [Cin][Cout][2][2][2], PyTorch's layout for a transposed convolution, for conv3d_up_forward().
PackedMatrix pack_conv3d_up(Context& ctx, const float* w, long cin, long cout, const std::string& what);
// The same from device memory, for weights that training changes. w [Cin, Cout, 2, 2, 2].
PackedMatrix pack_conv3d_up(Context& ctx, const Tensor& w, const std::string& what);

// out[2i + a] = x[i] W[:, :, a] + bias.
struct Conv3dUpForward {
  Tensor in;  // [X Y Z, Cin], x slowest
  long x = 0, y = 0, z = 0;
  const PackedMatrix* weights = nullptr;
  Tensor bias;  // [Cout] or none
  Tensor out;   // [2X 2Y 2Z, Cout]
  const char* name = "conv3d_up";
};
// Uses some 20 MiB of scratch memory: it processes some of the voxels at a time.
void conv3d_up_forward(Context& ctx, const Conv3dUpForward& a);

struct Conv3dUpBackward {
  Tensor in;  // the forward's
  long x = 0, y = 0, z = 0;
  Tensor w;      // [Cin, Cout, 2, 2, 2]
  Tensor dy;     // [2X 2Y 2Z, Cout]
  Tensor dx;     // [X Y Z, Cin], written
  Tensor dw;     // [Cin, Cout, 2, 2, 2], added to
  Tensor dbias;  // [Cout] or none, added to
  const char* name = "conv3d_up";
};
void conv3d_up_backward(Context& ctx, const Conv3dUpBackward& a);

}  // namespace vsplat

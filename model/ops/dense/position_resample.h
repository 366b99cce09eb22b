// Resamples the position embedding, stored for g x g tokens, to a grid of t x t tokens: bicubic (Keys, a = -0.5),
// widened when it shrinks the grid (antialiased), like PyTorch's interpolate with antialias=True. With t = g the values
// do not change.
#pragma once
#include <vector>

#include "runtime/context.h"

namespace vsplat {

// The stored positions that an output position uses along one axis: `taps` of them from first[i] on, with weights that
// add up to 1.
struct ResampleAxis {
  int taps = 0;
  std::vector<int> first;     // [t]
  std::vector<float> weight;  // [t, taps]; 0 beyond the grid
};
ResampleAxis bicubic_axis(int from, int to);
// The transposed table: the outputs that use each of `from` stored positions, with their weights.
ResampleAxis transposed(const ResampleAxis& axis, int from);

struct PositionResampleForward {
  Tensor stored;         // [1 + g g, C]: the class token's position, then the grid's
  Tensor class_token;    // [C]
  int from = 0, to = 0;  // g, t
  Tensor out;            // [1 + t t, C]: class token plus its position, then the grid's
};

// Uploads two small tables, so call it at load.
void position_resample_forward(Context& ctx, const PositionResampleForward& a);

struct PositionResampleBackward {
  Tensor dout;           // [1 + t t, C]: gradient by the forward's out
  int from = 0, to = 0;  // g, t
  Tensor dstored;        // [1 + g g, C], added to
  Tensor dclass_token;   // [C], added to
};

// Uploads two small tables.
void position_resample_backward(Context& ctx, const PositionResampleBackward& a);

}  // namespace vsplat

// Sines and cosines of positions at ten octaves.
#pragma once
#include "runtime/context.h"

namespace vsplat {

inline constexpr long kPositionEncoding = 63;

struct PositionEncodingForward {
  Tensor points;  // [P, 3]
  // [P, W]; columns column .. column + 62 are written: x, then sin(2^i x) and cos(2^i x) for i = 0 .. 9, 3 values each
  Tensor out;
  long column = 0;
};
void position_encoding_forward(Context& ctx, const PositionEncodingForward& a);

struct PositionEncodingBackward {
  Tensor points;   // [P, 3]
  Tensor dout;     // [P, W], of which columns column .. column + 62 are read
  Tensor dpoints;  // [P, 3], added to
  long column = 0;
};
void position_encoding_backward(Context& ctx, const PositionEncodingBackward& a);

}  // namespace vsplat

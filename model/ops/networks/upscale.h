// Replaces every point by several near it, with their features.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct UpscaleForward {
  Tensor raw;            // [P, 3 F]: offsets of F children from a point, before tanh
  Tensor points;         // [P, 3]
  Tensor feature;        // [P, C]
  long frequencies = 0;  // N
  double reach = 0;      // largest distance of a child from its point along an axis
  double unit = 1;       // factor of offsets in the sines and cosines
  Tensor children;       // [P F, 3], written: a point's children are consecutive
  Tensor offsets;        // [P F, 3], written: offsets from the point
  Tensor wide;           // [P F, 6 N + C], written: sines and cosines of 2^f unit offset, then the point's feature
};
void upscale_forward(Context& ctx, const UpscaleForward& a);

struct UpscaleBackward {
  Tensor raw;  // as in the forward
  long frequencies = 0;
  double reach = 0, unit = 1;
  Tensor dchildren;  // [P F, 3]
  Tensor dwide;      // [P F, 6 N + C]
  Tensor draw;       // [P, 3 F], written
  Tensor dpoints;    // [P, 3], written
  Tensor dfeature;   // [P, C], added to
};
void upscale_backward(Context& ctx, const UpscaleBackward& a);

}  // namespace vsplat

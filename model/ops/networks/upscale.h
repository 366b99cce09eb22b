// Every point becomes several, near it: where they lie, and what their features are made of.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct UpscaleForward {
  Tensor raw;            // [P, 3 F]: how far its F children lie from a point, before tanh
  Tensor points;         // [P, 3]
  Tensor feature;        // [P, C]
  long frequencies = 0;  // N
  double reach = 0;      // the farthest that a child lies from its point along an axis
  double unit = 1;       // what offsets are multiplied by before waves are made of them
  Tensor children;       // [P F, 3], written: a point's together
  Tensor offsets;        // [P F, 3], written: from the point
  Tensor wide;           // [P F, 6 N + C], written: sines and cosines of 2^f unit offset, then the point's feature
};
void upscale_forward(Context& ctx, const UpscaleForward& a);

struct UpscaleBackward {
  Tensor raw;  // as forward had it
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

// The loss of predicted rays: forward and backward in one call.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct RayLoss {
  Tensor predicted, target;  // [R, 6], R from 1
  Tensor out;                // [1]: the mean squared error of all numbers
  Tensor dpredicted;         // [R, 6]: its gradient times `gradient_scale`; none: not computed
  float gradient_scale = 1;
};
void ray_loss(Context& ctx, const RayLoss& a);

}  // namespace vsplat

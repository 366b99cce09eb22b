// LayerScale, a learnt scale for each output of a Linear, folded into the Linear: s (W x + b) = (s W) x + s b.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct LayerScaleForward {
  Tensor weight;      // [N, K]
  Tensor bias;        // [N]
  Tensor scale;       // [N]
  Tensor out_weight;  // [N, K]; written
  Tensor out_bias;    // [N]; written
};
void layer_scale_forward(Context& ctx, const LayerScaleForward& a);

struct LayerScaleBackward {
  Tensor weight, bias, scale;     // as in the forward
  Tensor dout_weight, dout_bias;  // gradients of the forward's outputs
  Tensor dweight, dbias, dscale;  // added to
};
void layer_scale_backward(Context& ctx, const LayerScaleBackward& a);

}  // namespace vsplat

// A network's confidence in each point, and the gradient of the choice made by it (straight through).
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct ConfidenceForward {
  Tensor logits;         // [P]
  bool softmax = false;  // over the points; else a sigmoid of each
  Tensor confidence;     // [P], written
};
void confidence_forward(Context& ctx, const ConfidenceForward& a);

// The choice leaves features unchanged; their gradient is that of feature x confidence.
struct ConfidenceBackward {
  Tensor x;              // [P, C]: the features
  Tensor confidence;     // [P], as the forward wrote it
  bool softmax = false;  // as in the forward
  Tensor dy;             // [P, C]: gradient of the chosen features
  Tensor dx;             // [P, C], written; may be dy
  Tensor dlogits;        // [P], written
};
void confidence_backward(Context& ctx, const ConfidenceBackward& a);

}  // namespace vsplat

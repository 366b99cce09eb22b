// Confidence per voxel, and the selection of voxels to refine.
#pragma once
#include <cstdint>
#include <string>

#include "runtime/context.h"

namespace vsplat {

enum class Selection : int { gumbel = 1, sigmoid = 2, ste = 3, opacity = 4 };
Selection selection_of(const std::string& name);  // from the configuration's word

struct SelectForward {
  Tensor logits;     // [n]; not used by opacity
  Tensor noise;      // [n] or none; only used by gumbel
  Tensor opacities;  // [n]
  Selection selection = Selection::gumbel;
  float temperature = 0.1f;          // for gumbel
  float opacity_threshold = 0.005f;  // for opacity
  Tensor factor;                     // [n]: factor of the opacity; or none
  Tensor refined;                    // [n]: opacity * factor; or none
  Tensor flags;                      // u32 [n]: 1 if the voxel is selected
};
void select_forward(Context& ctx, const SelectForward& a);

// The selection has no derivative. For the factor of "ste" (straight-through), 0 or 1, the derivative of sigmoid(logit)
// is used.
struct SelectBackward {
  Tensor logits, noise, opacities;  // [n], as in the forward
  Selection selection = Selection::gumbel;
  float temperature = 0.1f;
  Tensor drefined;    // [n]: gradient by the forward's refined
  Tensor dlogits;     // [n], written; or none. "opacity": 0
  Tensor dopacities;  // [n], written; may be drefined
};
void select_backward(Context& ctx, const SelectBackward& a);

// Logistic noise (the difference of two Gumbel variables). The same for equal seed, step and stream on every device, up
// to the rounding of its logarithms.
void logistic_noise(Context& ctx, const Tensor& noise /* [n] */, std::uint64_t seed, std::uint32_t step,
                    std::uint32_t stream);

}  // namespace vsplat

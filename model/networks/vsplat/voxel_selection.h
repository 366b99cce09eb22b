// Selects the voxels to refine, and scales every coarse primitive's opacity by its confidence.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "model/networks/params/config.h"
#include "model/ops/volume/select.h"
#include "runtime/context.h"

namespace vsplat {

struct SelectionOptions {
  float temperature = 0.1f;           // for selection "gumbel"
  Tensor noise;                       // f32 [R^3] or empty; added to the logits by "gumbel" only
  std::optional<std::uint64_t> seed;  // seed of logistic noise, used if `noise` is empty
  const std::vector<int>* forced =
      nullptr;       // these voxels, (i R + j) R + k, ascending, are selected instead; nothing else changes
  long planned = 0;  // P in a planning context
};

struct SelectedVoxels {
  Tensor factor;     // f32 [R^3]
  Tensor opacities;  // f32 [R^3], refined: multiplied by the factor
  Tensor index;      // i32 [P], ascending
  long count = 0;    // P
};

struct SelectionSaved {
  Tensor logits, noise, opacities;  // the inputs; noise may be empty
  Selection selection = Selection::gumbel;
  float temperature = 0.1f;
};

// logits and the coarse opacities [R^3]. Waits for the queue once to read P, unless `forced` is given. `saved`:
// receives what the backward needs.
SelectedVoxels select_voxels(Context& ctx, const Config& config, const Tensor& logits, const Tensor& opacities,
                             const SelectionOptions& options, SelectionSaved* saved = nullptr);
// Converts `dopacities` [R^3] from the gradient by the refined opacities to that by the coarse ones, in place. Returns
// the gradient by the logits [R^3]; empty for selection "opacity", which does not use them.
Tensor select_voxels_backward(Context& ctx, const SelectionSaved& saved, const Tensor& dopacities);

}  // namespace vsplat

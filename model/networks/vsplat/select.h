// Which voxels are refined, and how much every coarse primitive's opacity counts.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "model/networks/params/config.h"
#include "model/ops/volume/select.h"
#include "runtime/context.h"

namespace vsplat {

struct SelectionOptions {
  float temperature = 0.1f;           // of selection "gumbel"
  Tensor noise;                       // f32 [R^3] or none; "gumbel" alone adds it to the logits
  std::optional<std::uint64_t> seed;  // logistic noise made from this, where no noise is given
  const std::vector<int>* forced =
      nullptr;       // these voxels, (i R + j) R + k, ascending, are selected instead; nothing else changes
  long planned = 0;  // P in a planning context
};

struct SelectedVoxels {
  Tensor factor;     // f32 [R^3]
  Tensor opacities;  // f32 [R^3], refined: times the factor
  Tensor index;      // i32 [P], ascending
  long count = 0;    // P
};

struct SelectionSaved {
  Tensor logits, noise, opacities;  // as they were taken; noise may be none
  Selection selection = Selection::gumbel;
  float temperature = 0.1f;
};

// logits and the coarse opacities [R^3]. Waits for the queue, once, to know P (not with `forced`). What `saved` holds
// is for the backward.
SelectedVoxels select_voxels(Context& ctx, const Config& config, const Tensor& logits, const Tensor& opacities,
                             const SelectionOptions& options, SelectionSaved* saved = nullptr);
// `dopacities` [R^3] is by the refined opacities and becomes that by the coarse ones. Returns that by the logits [R^3];
// none for selection "opacity", which does not ask them.
Tensor select_voxels_backward(Context& ctx, const SelectionSaved& saved, const Tensor& dopacities);

}  // namespace vsplat

// Conversions between Network's options and results and those of LaRa's network and the networks built on it.
#pragma once
#include <vector>

#include "model/networks/lara/lara_model.h"
#include "model/networks/layers/forward_options.h"

namespace vsplat {

inline LaraOptions lara_options(const ForwardOptions& options) {
  LaraOptions out;
  out.tap = options.tap;
  out.progress = options.progress;
  out.planned_kept = options.planned_selected;
  out.fine = options.fine;
  return out;
}

// The voxels of the kept primitives, ascending like these.
inline std::vector<int> voxels_of(const std::vector<int>& kept, const LaraConfig& config) {
  std::vector<int> out;
  for (const int primitive : kept)
    if (const int voxel = primitive / config.primitives; out.empty() || out.back() != voxel) out.push_back(voxel);
  return out;
}

}  // namespace vsplat

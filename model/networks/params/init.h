// Initial weights, for training from scratch.
#pragma once
#include <cstdint>
#include <vector>

#include "model/networks/params/any_config.h"
#include "model/networks/params/weights.h"

namespace vsplat {

// Draws each of parameters(config) by its `init`. A value depends only on the seed, the parameter's name and the
// element's index, and is computed only with operations that IEEE 754 defines to the bit: a seed gives the same file
// everywhere.
Weights initial_weights(const AnyConfig& config, std::uint64_t seed);

// Rescales the fine primitives' offsets within their voxel, which are in units of the cube's edge, for another number
// of voxels: `factor` is the old number over the new one. Returns how many values it scaled.
std::size_t scale_places(Weights& weights, const Config& config, double factor);

// The first `count` points of the unscrambled three-dimensional Sobol sequence after the origin, in Gray-code order,
// [count,3] in (0,1).
std::vector<double> sobol_points(int count);

}  // namespace vsplat

// Initial weights, for training from scratch.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "model/networks/params/any_config.h"
#include "model/networks/params/weights.h"

namespace vsplat {

// Every one of parameters(config), drawn as its `init` says. A value depends on the seed, the parameter's name and the
// element's index alone, and takes only operations that IEEE 754 defines to the bit: a seed gives the same file
// everywhere.
Weights initial_weights(const Config& config, std::uint64_t seed);
Weights initial_weights(const LaraConfig& config, std::uint64_t seed);
Weights initial_weights(const GendenConfig& config, std::uint64_t seed);
Weights initial_weights(const VsplatGendenConfig& config, std::uint64_t seed);
Weights initial_weights(const AnyConfig& config, std::uint64_t seed);

// Scales the places of the fine primitives within their voxel, which are in units of the cube's edge, for a cube with
// another number of voxels: `factor` is the old number over the new one. How many values that were.
std::size_t scale_places(Weights& weights, const Config& config, double factor);

// The first `count` points of the unscrambled three-dimensional Sobol sequence after the origin, in Gray-code order,
// [count,3] in (0,1).
std::vector<double> sobol_points(int count);

}  // namespace vsplat

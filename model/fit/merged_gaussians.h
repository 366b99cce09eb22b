// Fewer Gaussians that show the same: those that share a cell of a grid become one.
#pragma once
#include "model/base/gaussians.h"

namespace vsplat {

// Merges volumes until at most `most` are left; returns them unchanged if there are no more. A merged Gaussian has the
// mean, covariance and colour of those in its cell, weighted by their light, which is opacity times area, and the
// opacity that keeps its light. If the cells are more than `most`, those with the least light are left out.
Gaussians merged_gaussians(const Gaussians& gaussians, std::size_t most);

}  // namespace vsplat

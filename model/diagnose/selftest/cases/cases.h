// What a self-test runs: a case for each operation, those first that others are made of. Sizes are those that break
// things: 1, 3, 7, primes, a tile and one to either side of it.
#pragma once
#include <vector>

#include "model/diagnose/selftest/checks.h"

namespace vsplat::selftest {

std::vector<Case> all_cases();

// A file each. A case holds everything that its operation's header declares against model/diagnose/selftest/reference/.
std::vector<Case> attention_cases();    // attention, rope
std::vector<Case> convolution_cases();  // of volumes: dense, of voxels, upwards
std::vector<Case> drawing_cases();      // Gaussians to pictures, and back
std::vector<Case> feature_cases();      // of points and voxels: features of the views, and what is made of them
std::vector<Case> fitting_cases();      // a scene's parameters
std::vector<Case> gaussian_cases();     // heads' numbers to Gaussians, which of them are refined
std::vector<Case> list_cases();         // sums, sorting, rows by index
std::vector<Case> norm_cases();         // LayerNorm, GroupNorm, scales of layers
std::vector<Case> picture_cases();      // losses on pictures, and what they are made of
std::vector<Case> point_cases();        // curves through points, their neighbours
std::vector<Case> product_cases();      // matrix products and what goes with them
std::vector<Case> projection_cases();   // derivatives of projections
std::vector<Case> surfel_cases();       // surfels to pictures, and back
std::vector<Case> token_cases();        // pictures to tokens, positions, rays
std::vector<Case> training_cases();     // optimisers

}  // namespace vsplat::selftest

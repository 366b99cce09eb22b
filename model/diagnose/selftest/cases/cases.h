// The cases of a self-test, one per operation, basic operations first. Their sizes provoke errors: 1, 3, 7, primes, a
// tile and one to either side of it.
#pragma once
#include <vector>

#include "model/diagnose/selftest/checks.h"

namespace vsplat::selftest {

std::vector<Case> all_cases();

// One function per file. A case compares everything that its operation's header declares with
// model/diagnose/selftest/reference/.
std::vector<Case> attention_cases();    // attention, rope
std::vector<Case> convolution_cases();  // over volumes: dense, sparse, transposed
std::vector<Case> drawing_cases();      // rendering and its backward
std::vector<Case> feature_cases();      // of points and voxels: features of the views, and further processing
std::vector<Case> fitting_cases();      // a scene's parameters
std::vector<Case> gaussian_cases();     // from the heads' values to Gaussians, and their selection
std::vector<Case> list_cases();         // sums, sorting, rows by index
std::vector<Case> norm_cases();         // LayerNorm, GroupNorm, scales of layers
std::vector<Case> picture_cases();      // losses on pictures, and their inputs
std::vector<Case> point_cases();        // curves through points, their neighbours
std::vector<Case> product_cases();      // matrix products and related operations
std::vector<Case> projection_cases();   // derivatives of projections
std::vector<Case> surfel_cases();       // rendering of surfels and its backward
std::vector<Case> token_cases();        // pictures to tokens, positions, rays
std::vector<Case> training_cases();     // optimisers

}  // namespace vsplat::selftest

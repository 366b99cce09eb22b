// Textured random solids, for those who have no meshes, and for tests.
#pragma once
#include <cstdint>

#include "model/data/mesh.h"

namespace vsplat {

// One to four rounded boxes, cylinders, balls, double cones, rings and turned vases, scaled, turned and pushed into one
// another, each with a procedural texture (checks, stripes, spots, clouds) of two random colours. The same for the
// same seed and index.
Mesh random_solid(std::uint64_t seed, std::uint32_t index);

}  // namespace vsplat

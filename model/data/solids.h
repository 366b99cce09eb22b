// Textured random solids, for tests and for users without meshes.
#pragma once
#include <cstdint>

#include "model/data/mesh.h"

namespace vsplat {

// One to four rounded boxes, cylinders, balls, double cones, rings and turned vases, scaled, rotated and overlapping,
// each with a procedural texture (checks, stripes, spots, clouds) in two random colours. The result only depends on
// seed and index.
Mesh random_solid(std::uint64_t seed, std::uint32_t index);

}  // namespace vsplat

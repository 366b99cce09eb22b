// An unlimited supply of random objects, for training and for users with few meshes.
#pragma once
#include <cstdint>

#include "model/data/mesh.h"
#include "model/data/paints.h"

namespace vsplat {

// One to nine parts that mostly touch: bodies, some with another body cut out, as bowls or with a height field; wire
// frames; thin rods, plates, hoops, springs and cables. Some are repeated about the vertical axis; some are twisted,
// bent or tapered, individually or all together. Each is painted in one colour, a gradient, a pattern or one of
// `textures` (may be null). The result only depends on seed, index and textures. Errors of textures that cannot be
// read.
Mesh random_object(std::uint64_t seed, std::uint32_t index, const TextureFolder* textures);

}  // namespace vsplat

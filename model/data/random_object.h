// Objects without end, for those who have few meshes, and to train on.
#pragma once
#include <cstdint>

#include "model/data/mesh.h"
#include "model/data/paints.h"

namespace vsplat {

// One to nine parts that mostly touch: bodies, some with another one cut out of them, as bowls or with a height field;
// wire frames; thin rods, plates, hoops, springs and cables; some repeated about the vertical; some twisted, bent or
// tapered, each by itself or all together. Painted in one colour, a gradient, a pattern or with one of `textures` (may
// be null). The same for the same seed, index and textures. Errors of textures that cannot be read.
Mesh random_object(std::uint64_t seed, std::uint32_t index, const TextureFolder* textures);

}  // namespace vsplat

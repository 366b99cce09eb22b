// Cameras all around an object at the origin, for data sets.
#pragma once
#include <cstdint>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

// `count` square cameras of `size` pixels and 49.1 degrees (those of GObjaverse) that look at the origin: directions of
// a Fibonacci sphere, turned about y and jittered by the seed and the object's index, y up in the pictures; distances
// from 1.6 to 1.9, or so much farther that a sphere of `radius` about the origin is wholly in every picture.
// Error(usage) for a count outside 1 to 9999 or a size outside 8 to 8192.
std::vector<Camera> sphere_cameras(int count, int size, double radius, std::uint64_t seed, std::uint32_t object);

}  // namespace vsplat

// Cameras all around an object at the origin, for data sets.
#pragma once
#include <cstdint>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

// `count` square cameras with `size` pixels and a field of view of 49.1 degrees (GObjaverse's) that look at the origin.
// Directions are those of a Fibonacci sphere, rotated about y and jittered by the seed and the object's index; y is up
// in the pictures. Distances are 1.6 to 1.9, or increased so that a sphere of `radius` about the origin is completely
// in every picture. Error(usage) for a count outside 1 to 9999 or a size outside 8 to 8192.
std::vector<Camera> sphere_cameras(int count, int size, double radius, std::uint64_t seed, std::uint32_t object);

}  // namespace vsplat

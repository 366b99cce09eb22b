// A smooth camera path through given key cameras.
#pragma once
#include <span>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

inline constexpr int max_path = 10000;

// `count` cameras on a smooth path through the keys, in their order. The first and last cameras equal the first and
// last keys bit for bit; with a single key or a single camera, all are the first key. Centres follow a cubic spline
// whose intervals take time proportional to the square root of their length (centripetal: no loops, no cusps), but at
// least a quarter of the mean interval's, so that rotating or zooming on the spot, or two equal keys, take time as
// well. Rotations follow the spline of the same velocities on the rotation group, along the shorter arc between keys
// (for half a turn, about the axis whose largest component is positive); between two keys this is a constant rotation.
// Fields of view (as logarithms) and principal points are interpolated relative to the picture's size; the size is the
// first key's. Files are 0000.png, ...; lens distortion is dropped.
//
// The keys' intrinsics must be known. Error(usage) if there is no key or `count` is not 1 to max_path; Error(input) if
// a key's picture has another aspect ratio than the first one's.
std::vector<Camera> camera_path(std::span<const Camera> keys, int count);

}  // namespace vsplat

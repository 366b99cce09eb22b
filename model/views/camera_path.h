// A smooth move through given cameras.
#pragma once
#include <span>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

inline constexpr int max_path = 10000;

// `count` cameras on a smooth path through the keys, in their order; the first and the last one are the first and the
// last key to the bit, all of them the first key where there is only one key or one camera. Centres follow a cubic
// spline whose stretches take time by the square root of their length (centripetal: no loops, no cusps), but at least a
// quarter of the mean stretch's, so that turning or zooming on the spot, or two equal keys, take time as well.
// Rotations follow the spline of the same velocities on the rotation group, by the shorter arc from key to key (half a
// turn has two: it goes about the axis whose largest component is positive); between two keys that is a constant turn.
// Fields of view (as logarithms) and principal points are interpolated, relative to the picture's size; the size is
// the first key's. Files are 0000.png, ...; lens distortion is left out.
//
// Keys: intrinsics known. Error(usage) where there is no key or `count` is not 1 to max_path; Error(input) where a
// key's picture has other proportions than the first one's.
std::vector<Camera> camera_path(std::span<const Camera> keys, int count);

}  // namespace vsplat

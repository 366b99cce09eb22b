// The order of points along a Morton curve, on which neighbours in a file are neighbours in space.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

namespace vsplat {

// The indices of the points in order; of equal points, the first comes first. There are fewer than 2^32.
std::vector<std::uint32_t> morton_order(const std::vector<std::array<std::uint16_t, 3>>& points);

}  // namespace vsplat

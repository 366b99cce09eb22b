// Polygons cut into triangles.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace vsplat::read {

// More corners in a polygon that is not convex would take too long: std::length_error.
inline constexpr std::size_t most_concave_corners = 10'000;

// The corners' places, in order round the polygon, which may be concave and need not be quite flat -> triangles of
// indices into them, wound as it is. They cover it and nothing else where its edges do not cross.
std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const std::array<float, 3>> corners);

}  // namespace vsplat::read

// Triangulates polygons.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace vsplat::read {

// Limit for concave polygons, because more corners would take too long: std::length_error.
inline constexpr std::size_t most_concave_corners = 10'000;

// `corners`: positions in order around the polygon, which may be concave and slightly non-planar. Returns triangles of
// indices into them, with the polygon's winding. If its edges do not cross, the triangles cover exactly the polygon.
std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const std::array<float, 3>> corners);

}  // namespace vsplat::read

#include "model/io/scene/morton_order.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace vsplat {
namespace {

// Moves the bits of `v` three apart.
std::uint64_t spread(std::uint16_t v) {
  std::uint64_t x = v;
  x = (x | x << 16) & 0x0000ff0000ff;
  x = (x | x << 8) & 0x00f00f00f00f;
  x = (x | x << 4) & 0x0c30c30c30c3;
  x = (x | x << 2) & 0x249249249249;
  return x;
}

}  // namespace

std::vector<std::uint32_t> morton_order(const std::vector<std::array<std::uint16_t, 3>>& points) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& p = points[i];
    keys[i] = {spread(p[0]) | spread(p[1]) << 1 | spread(p[2]) << 2, static_cast<std::uint32_t>(i)};
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> out(points.size());
  for (std::size_t i = 0; i < keys.size(); ++i) out[i] = keys[i].second;
  return out;
}

}  // namespace vsplat

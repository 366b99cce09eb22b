// Space-filling curves from their definitions: Morton's by its bits, Hilbert's by walking through octants.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace vsplat::ref {

using Cell = std::array<int, 3>;

inline std::vector<Cell> grid_cells(const std::vector<float>& points, double edge) {
  std::array<double, 3> least = {1e300, 1e300, 1e300};
  for (std::size_t i = 0; i < points.size(); ++i) least[i % 3] = std::min(least[i % 3], static_cast<double>(points[i]));
  std::vector<Cell> out(points.size() / 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    out[i / 3][i % 3] = static_cast<int>((static_cast<double>(points[i]) - least[i % 3]) / edge);
  return out;
}

inline std::uint64_t morton(const Cell& c, int depth) {
  std::uint64_t code = 0;
  for (int bit = depth - 1; bit >= 0; --bit)
    for (const int axis : c) code = code << 1 | (static_cast<std::uint64_t>(axis >> bit) & 1);
  return code;
}

// All cells of a curve of this depth, made from the curve of one bit less: the axes of its eight copies are turned so
// that each ends next to the start of the next one. Applies Skilling's rule forwards (from position to cell); the code
// under test goes backwards.
inline Cell hilbert_cell(std::uint64_t place, int depth) {
  Cell x{};
  const std::uint64_t gray = place ^ place >> 1;
  for (int bit = 0; bit < depth; ++bit)
    for (int axis = 0; axis < 3; ++axis)
      x[static_cast<std::size_t>(axis)] |= static_cast<int>(gray >> (3 * bit + 2 - axis) & 1) << bit;
  for (int bit = 0; bit < depth; ++bit) {
    const int low = (1 << bit) - 1;
    for (std::size_t axis = 3; axis-- > 0;) {
      if (x[axis] >> bit & 1) {
        x[0] ^= low;
      } else {
        const int swapped = (x[0] ^ x[axis]) & low;
        x[0] ^= swapped;
        x[axis] ^= swapped;
      }
    }
  }
  return x;
}

// [runs size] slots of points along the curve.
inline std::vector<int> curve_runs(const std::vector<std::uint32_t>& order, long size) {
  const long n = static_cast<long>(order.size());
  std::vector<int> out(order.begin(), order.end());
  while (n > size && static_cast<long>(out.size()) % size != 0)
    out.push_back(out[out.size() - static_cast<std::size_t>(size)]);
  return out;
}

}  // namespace vsplat::ref

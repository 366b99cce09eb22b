// Neighbours of points in cells by search, and a convolution's derivative by its inputs through them.
#pragma once
#include <vector>

#include "model/diagnose/selftest/reference/space_curve.h"

namespace vsplat::ref {

// The last point that lies in a cell, -1 where none does.
inline int standing(const std::vector<Cell>& cells, const Cell& cell) {
  int out = -1;
  for (std::size_t q = 0; q < cells.size(); ++q)
    if (cells[q] == cell) out = static_cast<int>(q);
  return out;
}

// [P,27]
inline std::vector<int> cell_map(const std::vector<Cell>& cells, bool all) {
  std::vector<int> map;
  for (std::size_t p = 0; p < cells.size(); ++p) {
    const bool stands = standing(cells, cells[p]) == static_cast<int>(p);
    for (int tap = 0; tap < 27; ++tap) {
      const Cell at = {cells[p][0] + tap / 9 - 1, cells[p][1] + tap / 3 % 3 - 1, cells[p][2] + tap % 3 - 1};
      map.push_back(tap == 13 ? static_cast<int>(p) : tap > 13 && !all && !stands ? -1 : standing(cells, at));
    }
  }
  return map;
}

}  // namespace vsplat::ref

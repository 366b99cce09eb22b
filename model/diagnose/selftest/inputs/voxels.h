// Random voxels of a volume, in random order.
#pragma once
#include <algorithm>

#include "model/diagnose/selftest/inputs/random_values.h"

namespace vsplat::selftest {

inline std::vector<int> some_voxels(int r, float share) {
  const auto lot = random_floats(size_of(r * r, r), 1, 0, 1);
  std::vector<int> out;
  for (std::size_t v = 0; v < lot.size(); ++v)
    if (lot[v] < share || v == 0) out.push_back(static_cast<int>(v));
  std::shuffle(out.begin(), out.end(), std::mt19937(2));
  return out;
}

}  // namespace vsplat::selftest

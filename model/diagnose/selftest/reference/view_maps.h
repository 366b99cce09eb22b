// The maps of the input views in double, from the definition.
#pragma once
#include <algorithm>
#include <vector>

namespace vsplat::ref {

// One pixel's numbers of a drawing -> the last five of its map.
inline std::vector<double> view_map(const double colour[3], double alpha, double depth, bool by_alpha) {
  std::vector<double> out;
  for (int c = 0; c < 3; ++c) out.push_back(std::clamp(colour[c], 0.0, 1.0));
  out.push_back(alpha);
  out.push_back(!by_alpha ? depth : alpha > 0 ? depth / alpha : 0);
  return out;
}

}  // namespace vsplat::ref

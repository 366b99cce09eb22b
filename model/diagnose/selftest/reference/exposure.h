// An affine map of an object's colours beside the background it is drawn over, in double.
#pragma once
#include <array>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// map: a matrix row by row, then an offset; colour [P,3], alpha [P].
inline std::vector<double> exposure(const std::vector<double>& map, const std::vector<double>& colour,
                                    const std::vector<double>& alpha, const std::array<double, 3>& background) {
  std::vector<double> out;
  for (std::size_t i = 0; i < alpha.size(); ++i)
    for (std::size_t r = 0; r < 3; ++r) {
      double sum = alpha[i] * map[9 + r] + (1 - alpha[i]) * background[r];
      for (std::size_t c = 0; c < 3; ++c) sum += map[3 * r + c] * (colour[3 * i + c] - (1 - alpha[i]) * background[c]);
      out.push_back(sum);
    }
  return out;
}

}  // namespace vsplat::ref

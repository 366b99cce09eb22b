// Order statistics of small sets of numbers.
#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

namespace vsplat {

// Nearest rank: the smallest value that is not exceeded by at least `share` of the values. `values` must not be empty.
inline double quantile(std::vector<double> values, double share) {
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(share * static_cast<double>(values.size()) - 1e-9)) - 1;
  const auto at = values.begin() + std::clamp<std::ptrdiff_t>(rank, 0, static_cast<std::ptrdiff_t>(values.size()) - 1);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The middle value, or the mean of the two middle values. `values` must not be empty.
inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

// Along each axis. `places` must not be empty.
inline Eigen::Vector3d median(const std::vector<Eigen::Vector3d>& places) {
  Eigen::Vector3d out;
  std::vector<double> values(places.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < places.size(); ++i) values[i] = places[i][axis];
    out[axis] = median(values);
  }
  return out;
}

}  // namespace vsplat

// The mean squared error of rays, in double.
#pragma once
#include <cstddef>
#include <vector>

namespace vsplat::ref {

template <class P>
double ray_loss(const std::vector<P>& predicted, const std::vector<float>& target) {
  double sum = 0;
  for (std::size_t i = 0; i < target.size(); ++i) sum += (predicted[i] - target[i]) * (predicted[i] - target[i]);
  return sum / static_cast<double>(target.size());
}

}  // namespace vsplat::ref

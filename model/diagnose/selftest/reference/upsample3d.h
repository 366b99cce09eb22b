// Trilinear upsampling by two in double, by the definition of align_corners = False.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "model/diagnose/selftest/reference/differences.h"

namespace vsplat::ref {

template <class T>
std::vector<double> upsample3d(const std::vector<T>& x, long depth, long height, long width, long c) {
  struct Axis {
    long low, high;
    double weight;  // of high
  };
  const auto axis = [](long o, long size) {
    const double at = std::max(0.0, (static_cast<double>(o) + 0.5) / 2 - 0.5);
    const long low = static_cast<long>(std::floor(at));
    return Axis{low, std::min(low + 1, size - 1), at - static_cast<double>(low)};
  };
  std::vector<double> y;
  for (long i = 0; i < 2 * depth; ++i) {
    for (long j = 0; j < 2 * height; ++j) {
      for (long k = 0; k < 2 * width; ++k) {
        const Axis a[3] = {axis(i, depth), axis(j, height), axis(k, width)};
        for (long channel = 0; channel < c; ++channel) {
          double sum = 0;
          for (int corner = 0; corner < 8; ++corner) {
            const long at[3] = {corner & 4 ? a[0].high : a[0].low, corner & 2 ? a[1].high : a[1].low,
                                corner & 1 ? a[2].high : a[2].low};
            const double w = (corner & 4 ? a[0].weight : 1 - a[0].weight) *
                             (corner & 2 ? a[1].weight : 1 - a[1].weight) *
                             (corner & 1 ? a[2].weight : 1 - a[2].weight);
            sum += w * x[static_cast<std::size_t>(((at[0] * height + at[1]) * width + at[2]) * c + channel)];
          }
          y.push_back(sum);
        }
      }
    }
  }
  return y;
}

// Its transpose, column by column: dx[i] is the inner product of dy with the upsampled volume that is 1 at i.
inline std::vector<double> upsample3d_backward(const std::vector<float>& dy, long depth, long height, long width,
                                               long c) {
  std::vector<double> dx;
  std::vector<float> one(dy.size() / 8, 0.0f);
  for (float& v : one) {
    v = 1.0f;
    dx.push_back(weighed(upsample3d(one, depth, height, width, c), dy));
    v = 0.0f;
  }
  return dx;
}

}  // namespace vsplat::ref

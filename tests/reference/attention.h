// Multi-head self-attention in double, with every weight in memory.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace vsplat::ref {

// qkv [v, t, 3, h, d] -> [v, t, h d]
inline std::vector<double> attention(const std::vector<float>& qkv, long v, long t, long h, long d) {
  const auto at = [&](long view, long token, long which, long head, long c) {
    return static_cast<double>(qkv[static_cast<std::size_t>((((view * t + token) * 3 + which) * h + head) * d + c)]);
  };
  std::vector<double> out(static_cast<std::size_t>(v * t * h * d));
  std::vector<double> weights(static_cast<std::size_t>(t));
  for (long view = 0; view < v; ++view) {
    for (long head = 0; head < h; ++head) {
      for (long i = 0; i < t; ++i) {
        for (long j = 0; j < t; ++j) {
          double dot = 0;
          for (long c = 0; c < d; ++c) dot += at(view, i, 0, head, c) * at(view, j, 1, head, c);
          weights[static_cast<std::size_t>(j)] = dot / std::sqrt(static_cast<double>(d));
        }
        const double top = *std::max_element(weights.begin(), weights.end());
        double total = 0;
        for (double& w : weights) total += w = std::exp(w - top);
        for (long c = 0; c < d; ++c) {
          double sum = 0;
          for (long j = 0; j < t; ++j) sum += weights[static_cast<std::size_t>(j)] * at(view, j, 2, head, c);
          out[static_cast<std::size_t>(((view * t + i) * h + head) * d + c)] = sum / total;
        }
      }
    }
  }
  return out;
}

}  // namespace vsplat::ref

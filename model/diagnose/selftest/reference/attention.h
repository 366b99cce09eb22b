// Multi-head self-attention in double, with every weight in memory.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace vsplat::ref {

// qkv [v, t, 3, h, d] -> [v, t, h d]
template <class F>
std::vector<double> attention(const std::vector<F>& qkv, long v, long t, long h, long d) {
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

// The gradient of sum(dout * attention(qkv)): through every weight, and through the softmax by its Jacobian, p_i ([i =
// j] - p_j).
template <class F>
std::vector<double> attention_backward(const std::vector<F>& qkv, long v, long t, long h, long d,
                                       const std::vector<double>& dout) {
  const auto place = [&](long view, long token, long which, long head, long c) {
    return static_cast<std::size_t>((((view * t + token) * 3 + which) * h + head) * d + c);
  };
  const auto at = [&](long view, long token, long which, long head, long c) {
    return static_cast<double>(qkv[place(view, token, which, head, c)]);
  };
  const double scale = 1 / std::sqrt(static_cast<double>(d));
  std::vector<double> out(qkv.size());
  std::vector<double> p(static_cast<std::size_t>(t)), by_p(static_cast<std::size_t>(t));
  for (long view = 0; view < v; ++view) {
    for (long head = 0; head < h; ++head) {
      for (long i = 0; i < t; ++i) {
        const double* g = dout.data() + ((view * t + i) * h + head) * d;
        double top = -1e300, total = 0;
        for (long j = 0; j < t; ++j) {
          double& score = p[static_cast<std::size_t>(j)] = 0;
          for (long c = 0; c < d; ++c) score += at(view, i, 0, head, c) * at(view, j, 1, head, c) * scale;
          top = std::max(top, score);
        }
        for (double& w : p) total += w = std::exp(w - top);
        for (double& w : p) w /= total;
        double mean = 0;
        for (long j = 0; j < t; ++j) {
          const auto n = static_cast<std::size_t>(j);
          by_p[n] = 0;
          for (long c = 0; c < d; ++c) {
            out[place(view, j, 2, head, c)] += p[n] * g[c];
            by_p[n] += g[c] * at(view, j, 2, head, c);
          }
          mean += p[n] * by_p[n];
        }
        for (long j = 0; j < t; ++j) {
          const auto n = static_cast<std::size_t>(j);
          const double by_score = p[n] * (by_p[n] - mean);
          for (long c = 0; c < d; ++c) {
            out[place(view, i, 0, head, c)] += by_score * scale * at(view, j, 1, head, c);
            out[place(view, j, 1, head, c)] += by_score * scale * at(view, i, 0, head, c);
          }
        }
      }
    }
  }
  return out;
}

}  // namespace vsplat::ref

// Attention in groups, in double, from the definition.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace vsplat::ref {

// Groups by their rows: queries[g], keys[g].
struct CrossAttentionCase {
  std::size_t heads = 1, width = 1;                      // H, D
  std::vector<double> q, k, v;                           // [Q, H D], [N, H D]
  std::vector<std::vector<int>> queries, keys;           // a key may be in several groups
  std::vector<std::vector<int>> query_parts, key_parts;  // as those; empty: of one part

  std::vector<double> forward() const {
    std::vector<double> out(q.size(), 0);
    for (std::size_t g = 0; g < queries.size(); ++g)
      for (std::size_t l = 0; l < queries[g].size(); ++l)
        for (std::size_t h = 0; h < heads; ++h) {
          const int row = queries[g][l];
          std::vector<double> p;
          double total = 0;
          for (std::size_t s = 0; s < keys[g].size(); ++s) {
            double score = 0;
            for (std::size_t i = 0; i < width; ++i) score += q[at(row, h) + i] * k[at(keys[g][s], h) + i];
            const bool stranger = !query_parts.empty() && query_parts[g][l] != key_parts[g][s];
            p.push_back(score / std::sqrt(static_cast<double>(width)) - (stranger ? 100 : 0));
          }
          const double largest = *std::max_element(p.begin(), p.end());
          for (double& x : p) total += x = std::exp(x - largest);
          for (std::size_t s = 0; s < p.size(); ++s)
            for (std::size_t i = 0; i < width; ++i) out[at(row, h) + i] += p[s] / total * v[at(keys[g][s], h) + i];
        }
    return out;
  }

  // The gradient of sum(dout out) by one of q, k and v, by central differences.
  std::vector<double> gradient(std::vector<double> CrossAttentionCase::*by, const std::vector<float>& dout) const {
    constexpr double step = 1e-5;
    CrossAttentionCase moved = *this;
    const auto loss = [&] {
      double sum = 0;
      const std::vector<double> out = moved.forward();
      for (std::size_t i = 0; i < out.size(); ++i) sum += out[i] * static_cast<double>(dout[i]);
      return sum;
    };
    std::vector<double> gradient;
    for (double& x : moved.*by) {
      const double before = x;
      x = before + step;
      const double above = loss();
      x = before - step;
      gradient.push_back((above - loss()) / (2 * step));
      x = before;
    }
    return gradient;
  }

 private:
  std::size_t at(int row, std::size_t h) const { return (static_cast<std::size_t>(row) * heads + h) * width; }
};

}  // namespace vsplat::ref

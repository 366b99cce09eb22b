// Attention in groups, in double, from the definition.
#pragma once
#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

namespace vsplat::ref {

// Groups by their rows: queries[g], keys[g].
struct CrossAttentionCase {
  std::size_t heads = 1, width = 1;                      // H, D
  std::vector<double> q, k, v;                           // [Q, H D], [N, H D]
  std::vector<std::vector<int>> queries, keys;           // a key may be in several groups, or twice in one
  std::vector<std::vector<int>> query_parts, key_parts;  // as those; empty: of one part

  std::vector<double> forward() const {
    std::vector<double> out(q.size(), 0);
    for (std::size_t g = 0; g < queries.size(); ++g)
      for (std::size_t l = 0; l < queries[g].size(); ++l)
        for (std::size_t h = 0; h < heads; ++h) {
          const std::vector<double> attended = attend(g, l, h);
          for (std::size_t i = 0; i < width; ++i) out[at(queries[g][l], h) + i] += attended[i];
        }
    return out;
  }

  // The gradient of sum(dout out) by one of q, k and v, by central differences. A row moves only its own head in the
  // groups that hold the row, so the sum runs over these alone.
  std::vector<double> gradient(std::vector<double> CrossAttentionCase::*by, const std::vector<float>& dout) const {
    constexpr double step = 1e-5;
    CrossAttentionCase moved = *this;
    const std::vector<std::vector<int>>& rows = by == &CrossAttentionCase::q ? queries : keys;
    std::vector<double> gradient((this->*by).size(), 0);
    for (std::size_t g = 0; g < rows.size(); ++g)
      for (const int row : std::set<int>(rows[g].begin(), rows[g].end()))
        for (std::size_t h = 0; h < heads; ++h)
          for (std::size_t i = at(row, h); i < at(row, h) + width; ++i) {
            double& x = (moved.*by)[i];
            const double before = x;
            x = before + step;
            const double above = moved.loss(g, h, dout);
            x = before - step;
            gradient[i] += (above - moved.loss(g, h, dout)) / (2 * step);
            x = before;
          }
    return gradient;
  }

 private:
  // Head h of the output of query l in group g: [D].
  std::vector<double> attend(std::size_t g, std::size_t l, std::size_t h) const {
    const int row = queries[g][l];
    std::vector<double> p, out(width, 0);
    for (std::size_t s = 0; s < keys[g].size(); ++s) {
      double score = 0;
      for (std::size_t i = 0; i < width; ++i) score += q[at(row, h) + i] * k[at(keys[g][s], h) + i];
      const bool stranger = !query_parts.empty() && query_parts[g][l] != key_parts[g][s];
      p.push_back(score / std::sqrt(static_cast<double>(width)) - (stranger ? 100 : 0));
    }
    const double largest = *std::max_element(p.begin(), p.end());
    double total = 0;
    for (double& x : p) total += x = std::exp(x - largest);
    for (std::size_t s = 0; s < p.size(); ++s)
      for (std::size_t i = 0; i < width; ++i) out[i] += p[s] / total * v[at(keys[g][s], h) + i];
    return out;
  }

  // The part of sum(dout out) that head h of group g has.
  double loss(std::size_t g, std::size_t h, const std::vector<float>& dout) const {
    double sum = 0;
    for (std::size_t l = 0; l < queries[g].size(); ++l) {
      const std::vector<double> attended = attend(g, l, h);
      for (std::size_t i = 0; i < width; ++i) sum += attended[i] * static_cast<double>(dout[at(queries[g][l], h) + i]);
    }
    return sum;
  }

  std::size_t at(int row, std::size_t h) const { return (static_cast<std::size_t>(row) * heads + h) * width; }
};

}  // namespace vsplat::ref

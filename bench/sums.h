// Single results in double, for sampled checks.
#pragma once
#include <cmath>
#include <vector>

namespace vsplat::bench {

// Number n of what a token, row `row` of all views' [V t, 3, c] queries, keys and values, makes of its view's values.
inline double attention_at(const std::vector<float>& qkv, long tokens, long heads, long c, long row, long n) {
  const long d = c / heads, head = n / d * d, first = row / tokens * tokens;
  const auto at = [&](long token, long which, long i) {
    return static_cast<double>(qkv[static_cast<std::size_t>((token * 3 + which) * c + i)]);
  };
  std::vector<double> scores;
  double top = -INFINITY, total = 0, sum = 0;
  for (long j = 0; j < tokens; ++j) {
    double dot = 0;
    for (long i = 0; i < d; ++i) dot += at(row, 0, head + i) * at(first + j, 1, head + i);
    scores.push_back(dot / std::sqrt(static_cast<double>(d)));
    if (scores.back() > top) top = scores.back();
  }
  for (long j = 0; j < tokens; ++j) {
    const double weight = std::exp(scores[static_cast<std::size_t>(j)] - top);
    total += weight;
    sum += weight * at(first + j, 2, n);
  }
  return sum / total;
}

}  // namespace vsplat::bench

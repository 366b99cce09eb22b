// The k largest by sorting, equal ones in their own order.
#pragma once
#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

namespace vsplat::ref {

inline std::vector<std::uint32_t> top_k(const std::vector<float>& x, std::size_t k) {
  std::vector<std::size_t> order(x.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return x[a] > x[b]; });
  std::vector<std::uint32_t> flags(x.size(), 0);
  for (std::size_t i = 0; i < std::min(k, x.size()); ++i) flags[order[i]] = 1;
  return flags;
}

}  // namespace vsplat::ref

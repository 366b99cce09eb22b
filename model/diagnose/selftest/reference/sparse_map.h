// Neighbours by search.
#pragma once
#include <cstddef>
#include <vector>

namespace vsplat::ref {

inline std::vector<int> sparse_map(const std::vector<int>& index, int r) {
  std::vector<int> map;
  for (const int v : index) {
    for (int a = -1; a <= 1; ++a) {
      for (int b = -1; b <= 1; ++b) {
        for (int c = -1; c <= 1; ++c) {
          int row = -1;
          for (std::size_t q = 0; q < index.size(); ++q) {
            const int u = index[q];
            if (u / (r * r) == v / (r * r) + a && u / r % r == v / r % r + b && u % r == v % r + c)
              row = static_cast<int>(q);
          }
          map.push_back(row);
        }
      }
    }
  }
  return map;
}

}  // namespace vsplat::ref

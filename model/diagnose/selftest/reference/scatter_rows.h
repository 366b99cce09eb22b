// Scattering in double, entry after entry.
#pragma once
#include <vector>

namespace vsplat::ref {

// out [rows, channels] is added to.
inline void scatter_rows(const std::vector<int>& index, const std::vector<float>& weight, const std::vector<float>& d,
                         std::size_t channels, std::size_t first, std::size_t per_row, double scale,
                         std::vector<double>& out) {
  for (std::size_t e = 0; e < index.size(); ++e) {
    if (index[e] < 0) continue;
    for (std::size_t c = 0; c < channels; ++c)
      out[static_cast<std::size_t>(index[e]) * channels + c] +=
          scale * static_cast<double>(weight[e]) * static_cast<double>(d[(first + e / per_row) * channels + c]);
  }
}

}  // namespace vsplat::ref

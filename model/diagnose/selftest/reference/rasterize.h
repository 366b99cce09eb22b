// Blending of binned records in double, pixel by pixel: the reference for cl/render/rasterize.cl by itself.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace vsplat::ref {

struct Blended {
  std::vector<double> colour, alpha, depth;  // [H,W,3], [H,W], [H,W]
  std::uint64_t pairs = 0;                   // of a pixel and a record that is blended into it
};

// records [K,12], ids and starts as in model/ops/render/tile_bin.h.
inline Blended blend(const std::vector<float>& records, const std::vector<std::uint32_t>& ids,
                     const std::vector<std::uint32_t>& starts, int width, int height,
                     const std::array<float, 3>& background) {
  Blended out;
  const int tiles_x = (width + 15) / 16;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double T = 1, sum = 0, depth = 0, rgb[3] = {0, 0, 0};
      const auto tile =
          static_cast<std::size_t>(y / 16) * static_cast<std::size_t>(tiles_x) + static_cast<std::size_t>(x / 16);
      for (std::uint32_t i = starts[tile]; i < starts[tile + 1]; ++i) {
        const float* r = &records[12 * std::size_t{ids[i]}];
        const double dx = r[0] - (x + 0.5), dy = r[1] - (y + 0.5), t = dy - r[5] * dx;
        const double a = std::min<double>(0.99f, std::exp2(r[4] + r[6] * dx * dx + r[7] * t * t));
        if (a < static_cast<double>(1.0f / 255.0f)) continue;
        if (T * (1 - a) < static_cast<double>(1e-4f)) break;
        for (int c = 0; c < 3; ++c) rgb[c] += T * a * r[8 + c];
        depth += T * a * r[3];
        sum += T * a;
        T *= 1 - a;
        ++out.pairs;
      }
      for (std::size_t c = 0; c < 3; ++c) out.colour.push_back(rgb[c] + (1 - sum) * background[c]);
      out.alpha.push_back(sum);
      out.depth.push_back(depth);
    }
  }
  return out;
}

}  // namespace vsplat::ref

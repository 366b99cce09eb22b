// The derivative of blending in double, pixel by pixel and far to near: the reference for
// cl/render/rasterize_backward.cl by itself.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace vsplat::ref {

// The content of a row: the columns of cl/render/rasterize_backward.cl, or, with pulls, the two of its PULL.
enum class RowKind { sums, pulls, pulls_through_clamp };

// records [V,12], ids [N] and starts as in model/ops/render/tile_bin.h; derivatives of a loss by colour [H,W,3], alpha
// and depth [H,W]. Returns [N,10] (or [N,2]), the rows of cl/render/rasterize_backward.cl in the order of ids.
inline std::vector<double> blend_backward(const std::vector<float>& records, const std::vector<std::uint32_t>& ids,
                                          const std::vector<std::uint32_t>& starts, int width, int height,
                                          const std::array<float, 3>& background, const std::vector<float>& by_colour,
                                          const std::vector<float>& by_alpha, const std::vector<float>& by_depth,
                                          RowKind kind = RowKind::sums) {
  struct Seen {
    std::size_t i;
    double alpha, before, dx, t, full;
    bool held;
  };
  const std::size_t columns = kind == RowKind::sums ? 10 : 2;
  std::vector<double> rows(columns * ids.size());
  std::size_t pixel = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++pixel) {
      const int tiles_x = (width + 15) / 16, tile_row = y / 16, tile_column = x / 16;
      const auto tile = static_cast<std::size_t>(tile_row) * static_cast<std::size_t>(tiles_x) +
                        static_cast<std::size_t>(tile_column);
      std::vector<Seen> all;
      double T = 1;
      for (std::size_t i = starts[tile]; i < starts[tile + 1]; ++i) {
        const float* r = &records[12 * std::size_t{ids[i]}];
        const double dx = r[0] - (x + 0.5), t = r[1] - (y + 0.5) - r[5] * dx;
        const double full = std::exp2(r[4] + r[6] * dx * dx + r[7] * t * t), a = std::min<double>(0.99f, full);
        if (a < static_cast<double>(1.0f / 255.0f)) continue;
        if (T * (1 - a) < static_cast<double>(1e-4f)) break;
        all.push_back({i, a, T, dx, t, full, full > static_cast<double>(0.99f)});
        T *= 1 - a;
      }
      double by_after = 0;  // the loss by the transmittance after this Gaussian
      for (std::size_t c = 0; c < 3; ++c) by_after += by_colour[3 * pixel + c] * background[c];
      for (auto s = all.rbegin(); s != all.rend(); ++s) {
        const float* r = &records[12 * std::size_t{ids[s->i]}];
        double by_weight = by_alpha[pixel] + by_depth[pixel] * r[3];
        for (std::size_t c = 0; c < 3; ++c) by_weight += by_colour[3 * pixel + c] * r[8 + c];
        const double w = s->before * s->alpha;
        const double by_free = kind == RowKind::pulls_through_clamp ? s->full : s->held ? 0 : s->alpha;
        const double h = by_free * s->before * (by_weight - by_after);
        if (kind != RowKind::sums) {
          // ln alpha = ln 2 (.. + qx dx^2 + qy (dy - k dx)^2)
          const double ln4 = 2 * std::log(2.0), by_t = ln4 * r[7] * s->t;
          rows[2 * s->i] += std::abs(h * (ln4 * r[6] * s->dx - r[5] * by_t));
          rows[2 * s->i + 1] += std::abs(h * by_t);
          by_after = s->alpha * by_weight + (1 - s->alpha) * by_after;
          continue;
        }
        const double row[] = {h,
                              h * s->dx,
                              h * s->t,
                              h * s->dx * s->dx,
                              h * s->dx * s->t,
                              h * s->t * s->t,
                              w * by_colour[3 * pixel],
                              w * by_colour[3 * pixel + 1],
                              w * by_colour[3 * pixel + 2],
                              w * by_depth[pixel]};
        for (std::size_t c = 0; c < columns; ++c) rows[columns * s->i + c] += row[c];
        by_after = s->alpha * by_weight + (1 - s->alpha) * by_after;
      }
    }
  }
  return rows;
}

}  // namespace vsplat::ref

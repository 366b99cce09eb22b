// Blending of binned surfels' records in double, pixel by pixel: the reference for cl/render/rasterize_surfels.cl by
// itself.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/diagnose/selftest/reference/surfels.h"

namespace vsplat::ref {

// What a pixel sees of a record r [20].
template <class Number>
Meeting meet_record(const Number* r, double x, double y, const SurfelOptions& o) {
  const double dx = r[0] - x, dy = r[1] - y, h = 1 + r[8] * dx + r[9] * dy;
  if (h == 0) return {};
  const double s = (r[4] * dx + r[5] * dy) / h, t = (r[6] * dx + r[7] * dy) / h;
  const double bx = r[10] + dx, by = r[11] + dy, rho3 = s * s + t * t, rho2 = 2 * (bx * bx + by * by);
  const double depth = rho3 <= rho2 || o.current ? r[3] / h : r[3];
  const double alpha = std::min<double>(0.99f, std::exp2(r[2]) * std::exp(-0.5 * std::min(rho3, rho2)));
  if (!(depth >= o.options.near) || alpha < static_cast<double>(1.0f / 255.0f)) return {};
  return {alpha, depth};
}

// records [V,20], ids and starts as in model/ops/render/tile_bin.h.
template <class Number>
SurfelFrame blend_surfels(const std::vector<Number>& records, const std::vector<std::uint32_t>& ids,
                          const std::vector<std::uint32_t>& starts, int width, int height, const SurfelOptions& o) {
  SurfelFrame out;
  const int tiles_x = (width + 15) / 16;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      SurfelPixel pixel;
      const auto tile =
          static_cast<std::size_t>(y / 16) * static_cast<std::size_t>(tiles_x) + static_cast<std::size_t>(x / 16);
      for (std::uint32_t i = starts[tile]; i < starts[tile + 1]; ++i) {
        const Number* r = &records[20 * std::size_t{ids[i]}];
        const Meeting at = meet_record(r, x + 0.5, y + 0.5, o);
        if (at.alpha > 0 && !pixel.add(at, {r[12], r[13], r[14]}, {r[16], r[17], r[18]}, o.options.near)) break;
      }
      pixel.write(o.options.background, out);
    }
  }
  return out;
}

}  // namespace vsplat::ref

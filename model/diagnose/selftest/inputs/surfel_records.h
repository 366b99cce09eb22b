// Random projected surfels, already in tiles: what blending and its derivative are tested with.
#pragma once
#include <cmath>
#include <cstdint>
#include <random>

#include "model/diagnose/selftest/inputs/records.h"
#include "model/diagnose/selftest/reference/rasterize_surfels.h"
#include "model/diagnose/selftest/reference/surfels.h"

namespace vsplat::selftest {

// `per_tile` surfels near each tile of records [V,20], of sizes from under a pixel to the tile's and turned at random,
// each seen by its own tile and every third by the next one, too. Thresholds are kept away from only by chance.
inline Records make_surfel_records(int width, int height, int per_tile, float opacity, std::uint32_t seed,
                                   const ref::SurfelOptions& options) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform;
  std::normal_distribution<double> normal;
  Records c;
  const int tiles_x = (width + 15) / 16, tiles = tiles_x * ((height + 15) / 16);
  std::vector<std::uint32_t> shared;
  for (int tile = 0; tile < tiles; ++tile) {
    c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
    if (tile % 5 == 4) continue;  // some see nothing
    c.ids.insert(c.ids.end(), shared.begin(), shared.end());
    shared.clear();
    for (int i = 0; i < per_tile; ++i) {
      const double z = 1 + 0.01 * i, focal = 60;
      const int left = tile % tiles_x * 16, top = tile / tiles_x * 16;
      Gaussians g;
      g.count = 1;
      const double size[] = {std::exp(2.5 * uniform(engine) - 0.5), std::exp(2.5 * uniform(engine) - 0.5)};
      g.means = {static_cast<float>((left + 20 * uniform(engine) - 2 - 30) * z / focal),
                 static_cast<float>((top + 20 * uniform(engine) - 2 - 20) * z / focal), static_cast<float>(z)};
      for (const double s : size) g.scales.push_back(static_cast<float>(s * z / focal));
      for (int q = 0; q < 4; ++q) g.quats.push_back(static_cast<float>(normal(engine)));
      g.opacities = {static_cast<float>(opacity * (0.5 + 0.5 * uniform(engine)))};
      for (int j = 0; j < 3; ++j) g.sh.push_back(static_cast<float>(4 * uniform(engine) - 1.5));
      Camera cam;
      cam.width = width, cam.height = height, cam.fx = cam.fy = focal, cam.cx = 30, cam.cy = 20;
      std::array<double, 20> r = ref::record_of(ref::project_surfel(g, 0, cam, options));
      // Reaches as they are, but for every fourth, which may be anywhere.
      r[15] = r[19] = i % 4 == 3 ? 1e30 : 0;
      for (int y = top - 40; y < top + 56 && i % 4 != 3; ++y) {
        for (int x = left - 40; x < left + 56; ++x) {
          if (ref::meet_record(r.data(), x + 0.5, y + 0.5, options).alpha == 0) continue;
          r[15] = std::max(r[15], std::abs(r[0] - x - 0.5) + 0.01);
          r[19] = std::max(r[19], std::abs(r[1] - y - 0.5) + 0.01);
        }
      }
      const auto id = static_cast<std::uint32_t>(c.records.size() / 20);
      c.ids.push_back(id);
      if (i % 3 == 0) shared.push_back(id);
      for (const double v : r) c.records.push_back(static_cast<float>(v));
    }
  }
  c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
  return c;
}

}  // namespace vsplat::selftest

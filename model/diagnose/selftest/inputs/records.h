// Random projected Gaussians, already in tiles: what blending and its derivative are tested with.
#pragma once
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <vector>

namespace vsplat::selftest {

struct Records {
  std::vector<float> records;              // [V,12], of surfels [V,20]
  std::vector<std::uint32_t> ids, starts;  // [N], [tiles + 1]
};

// `per_tile` records near each tile, of sizes from a pixel to the tile, each seen by its own tile and every third by
// the next one, too. Alpha keeps away from its thresholds' neighbourhood only by chance.
inline Records make_records(int width, int height, int per_tile, float opacity, std::uint32_t seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> uniform;
  Records c;
  const int tiles_x = (width + 15) / 16, tiles = tiles_x * ((height + 15) / 16);
  std::vector<std::uint32_t> shared;
  for (int tile = 0; tile < tiles; ++tile) {
    c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
    if (tile % 5 == 4) continue;  // some see nothing
    c.ids.insert(c.ids.end(), shared.begin(), shared.end());
    shared.clear();
    for (int i = 0; i < per_tile; ++i) {
      const int left = tile % tiles_x * 16, top = tile / tiles_x * 16;
      const float u = static_cast<float>(left) + 20 * uniform(engine) - 2;
      const float v = static_cast<float>(top) + 20 * uniform(engine) - 2;
      const float a = 0.5f + 40 * uniform(engine), d = 0.4f + 10 * uniform(engine), k = 2 * uniform(engine) - 1;
      const float o = opacity * (0.5f + 0.5f * uniform(engine));
      const float vertical = d + k * k * a, reach = std::sqrt(2 * vertical * std::log(255 * o)) + 0.1f;
      const auto id = static_cast<std::uint32_t>(c.records.size() / 12);
      c.ids.push_back(id);
      if (i % 3 == 0) shared.push_back(id);
      const float log2e = 1.4426950409f;
      for (const float f :
           {u, v, reach, 1 + static_cast<float>(i) * 0.01f, std::log2(o), k, -0.5f * log2e / a, -0.5f * log2e / d})
        c.records.push_back(f);
      for (int j = 0; j < 3; ++j) c.records.push_back(2 * uniform(engine));
      c.records.push_back(0);
    }
  }
  c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
  return c;
}

// Where each record's run of intersections begins, [V+1], when they are ordered by record. `numbers`: of a record.
inline std::vector<std::uint32_t> offsets_of(const Records& c, std::size_t numbers = 12) {
  std::vector<std::uint32_t> offsets(c.records.size() / numbers + 1, 0);
  for (const std::uint32_t id : c.ids) ++offsets[id + 1];
  std::partial_sum(offsets.begin(), offsets.end(), offsets.begin());
  return offsets;
}

// The place of each intersection in that order.
inline std::vector<std::uint32_t> slots_of(const Records& c, std::size_t numbers = 12) {
  std::vector<std::uint32_t> next = offsets_of(c, numbers), slots;
  for (const std::uint32_t id : c.ids) slots.push_back(next[id]++);
  return slots;
}

// What was written of each intersection, in the order of ids; zeros where nothing was.
inline std::vector<float> rows_in_order(const std::vector<float>& rows, const std::vector<std::uint8_t>& touched,
                                        const std::vector<std::uint32_t>& slots, std::size_t numbers) {
  std::vector<float> out(rows.size(), 0.0f);
  for (std::size_t i = 0; i < slots.size(); ++i)
    for (std::size_t col = 0; col < numbers && touched[slots[i]]; ++col)
      out[numbers * i + col] = rows[numbers * slots[i] + col];
  return out;
}

}  // namespace vsplat::selftest

#include "model/ops/render/tile_bin.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/render/project.h"

namespace vsplat::selftest {
namespace {

void tile_bin_of(Checks& c, long count, int tiles_x, int tiles_y) {
  std::mt19937 engine(static_cast<std::uint32_t>(count));
  std::vector<std::uint32_t> rects, keys, order(size_of(count)), ids, starts, offsets{0}, slots;
  for (long k = 0; k < count; ++k) {
    std::uint32_t x0 = engine() % static_cast<unsigned>(tiles_x), x1 = engine() % static_cast<unsigned>(tiles_x);
    std::uint32_t y0 = engine() % static_cast<unsigned>(tiles_y), y1 = engine() % static_cast<unsigned>(tiles_y);
    if (x0 > x1) std::swap(x0, x1);
    if (y0 > y1) std::swap(y0, y1);
    x1 = std::min(x1 + 1, x0 + (k % 2 ? 2u : 4u));
    y1 = std::min(y1 + 1, y0 + (k % 2 ? 2u : 3u));
    rects.push_back(x0 | x1 << 16), rects.push_back(y0 | y1 << 16);
    offsets.push_back(offsets.back() + (x1 - x0) * (y1 - y0));
    keys.push_back(engine() % 50);
  }
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return keys[a] < keys[b]; });
  std::vector<std::uint32_t> next = offsets;
  for (std::uint32_t ty = 0; ty < static_cast<unsigned>(tiles_y); ++ty)
    for (std::uint32_t tx = 0; tx < static_cast<unsigned>(tiles_x); ++tx) {
      starts.push_back(static_cast<std::uint32_t>(ids.size()));
      for (const std::size_t k : order) {
        const std::uint32_t x = rects[2 * k], y = rects[2 * k + 1];
        if (tx < (x & 0xffff) || tx >= x >> 16 || ty < (y & 0xffff) || ty >= y >> 16) continue;
        ids.push_back(static_cast<std::uint32_t>(k));
        slots.push_back(next[k]++);
      }
    }
  starts.push_back(static_cast<std::uint32_t>(ids.size()));
  for (const bool with_slots : {false, true}) {
    Projected p;
    p.rects = c.up({count, 2}, rects), p.keys = c.up({count}, keys), p.key_bits = 6;
    const Binned got = tile_bin(c.ctx, p, ids.size(), {3, 5, 3 + tiles_x, 5 + tiles_y}, {with_slots, false});
    c.equal("who is in a tile", got.ids, ids);
    c.equal("tiles' runs", got.starts, starts);
    if (!with_slots) continue;
    c.equal("Gaussians' runs", got.offsets, offsets);
    c.equal("slots", got.slots, slots);
  }
}

// With the exact test a tile is left out where no pixel of it has alpha >= 1/255, and nowhere else.
void tile_bin_exact(Checks& c) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> uniform;
  constexpr long count = 300;
  constexpr int tiles_x = 30, tiles_y = 20;
  std::vector<float> records;
  std::vector<std::uint32_t> rects, keys;
  std::uint64_t pairs = 0;
  for (long i = 0; i < count; ++i) {  // blobs and long, thin, slanted ones
    const float u = 16 * (2 + tiles_x * uniform(engine)), v = 16 * (1 + tiles_y * uniform(engine));
    const float a = std::pow(10.0f, 4 * uniform(engine) - 0.5f), d = 0.3f + 30 * uniform(engine) * uniform(engine);
    const float k = 4 * uniform(engine) - 2, lo = -8 * uniform(engine), log2e = 1.4426950409f;
    for (const float f : {u, v, 0.0f, 1.0f, lo, k, -0.5f * log2e / a, -0.5f * log2e / d, 0.0f, 0.0f, 0.0f, 0.0f})
      records.push_back(f);
    const bool wide = i % 3 == 0;
    const std::uint32_t x0 = wide ? 0 : std::min(static_cast<unsigned>(u / 16) - 2, tiles_x - 2u),
                        y0 = wide ? 0 : std::min(static_cast<unsigned>(v / 16) - 1, tiles_y - 2u),
                        w = wide ? tiles_x : 2, h = wide ? tiles_y : 2;
    rects.push_back(x0 | (x0 + w) << 16), rects.push_back(y0 | (y0 + h) << 16);
    pairs += std::uint64_t{w} * h;
    keys.push_back(engine() % 50);
  }
  Projected p;
  p.rects = c.up({count, 2}, rects), p.keys = c.up({count}, keys), p.key_bits = 6,
  p.records = c.up({count, 12}, records);
  const Binned got = tile_bin(c.ctx, p, pairs, {2, 1, 2 + tiles_x, 1 + tiles_y}, {true, true});
  const auto ids = c.ctx.read<std::uint32_t>(got.ids), starts = c.ctx.read<std::uint32_t>(got.starts),
             offsets = c.ctx.read<std::uint32_t>(got.offsets), slots = c.ctx.read<std::uint32_t>(got.slots);
  const auto room = [&](std::size_t id, int tile) {  // margin of the largest exponent over the drawing threshold
    const float* r = &records[12 * id];
    const int left = 16 * (2 + tile % tiles_x), top = 16 * (1 + tile / tiles_x);
    double most = -1e30;
    // On a grid finer than a tile's pixels. In a column the grid point nearest to the slant has the largest exponent.
    for (int x = 0; x <= 60; ++x) {
      const double dx = r[0] - (left + 0.5 + x / 4.0), slant = r[1] - (top + 0.5) - r[5] * dx;
      const double t = slant - std::clamp(std::round(4 * slant), 0.0, 60.0) / 4;
      most = std::max(most, r[4] + r[6] * dx * dx + r[7] * t * t);
    }
    return most + std::log2(255.0);
  };
  bool right = starts.back() < pairs * 9 / 10;
  std::vector<std::uint32_t> next(offsets.begin(), offsets.end());
  int small = 0;  // those that have a bit per tile
  for (int tile = 0; right && tile < tiles_x * tiles_y; ++tile) {
    const auto t = static_cast<std::size_t>(tile);
    std::uint32_t inside = 0;  // ids of this tile's Gaussians that the list has
    for (std::uint32_t id = 0; right && id < count; ++id) {
      const std::uint32_t x = rects[2 * std::size_t{id}], y = rects[2 * std::size_t{id} + 1];
      const std::uint32_t tx = static_cast<unsigned>(tile % tiles_x), ty = static_cast<unsigned>(tile / tiles_x);
      if (tx < (x & 0xffff) || tx >= x >> 16 || ty < (y & 0xffff) || ty >= y >> 16) continue;
      const bool kept =
          std::find(ids.begin() + starts[t], ids.begin() + starts[t + 1], id) != ids.begin() + starts[t + 1];
      inside += kept;
      if (kept && id % 3 == 0) continue;
      small += kept;
      const double by = room(id, tile);
      right = kept ? by > -1.0 : by < 0;
    }
    right = right && inside == starts[t + 1] - starts[t];
    for (std::uint32_t i = starts[t]; right && i < starts[t + 1]; ++i) {
      const bool in_order = i == starts[t] || std::pair(keys[ids[i - 1]], ids[i - 1]) < std::pair(keys[ids[i]], ids[i]);
      right = in_order && slots[i] == next[ids[i]]++;
    }
  }
  for (std::size_t k = 0; right && k < static_cast<std::size_t>(count); ++k) right = next[k] == offsets[k + 1];
  c.that("tiles that are reached", right && small > 50);
}

void tile_bin_all(Checks& c) {
  for (const long count : c.some({1L, 3L, 7L, 63L, 64L, 65L, 1500L}, {0L})) tile_bin_of(c, count, 13, 9);
  tile_bin_of(c, 65, 1, 1);
  tile_bin_of(c, 9000, 40, 30);
  tile_bin_exact(c);
  if (!c.all) return;
  for (const long count : {0L, 1L, 3L, 7L, 63L, 64L, 65L, 1500L}) tile_bin_of(c, count, 1, 1);  // no bit to sort by
  tile_bin_of(c, 500, 3, 2);
}

}  // namespace

VSPLAT_CASES(tile_bin, {"tile_bin", tile_bin_all})

}  // namespace vsplat::selftest

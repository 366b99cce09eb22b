#include "model/ops/render/tile_bin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class TileBin : public test::FlavourTest {
 protected:
  struct Case {
    std::vector<std::uint32_t> rects, keys;
    Projected projected;
    std::uint64_t pairs = 0;
  };

  // `count` Gaussians on random rectangles of tiles, from one tile to 4 x 3, depths of which many are equal.
  Case make(long count, int tiles_x, int tiles_y, std::uint32_t seed) {
    std::mt19937 engine(seed);
    Case c;
    for (long k = 0; k < count; ++k) {
      std::uint32_t x0 = engine() % static_cast<unsigned>(tiles_x), x1 = engine() % static_cast<unsigned>(tiles_x);
      std::uint32_t y0 = engine() % static_cast<unsigned>(tiles_y), y1 = engine() % static_cast<unsigned>(tiles_y);
      if (x0 > x1) std::swap(x0, x1);
      if (y0 > y1) std::swap(y0, y1);
      x1 = std::min(x1 + 1, x0 + (k % 2 ? 2u : 4u));
      y1 = std::min(y1 + 1, y0 + (k % 2 ? 2u : 3u));
      c.rects.push_back(x0 | x1 << 16);
      c.rects.push_back(y0 | y1 << 16);
      c.pairs += (x1 - x0) * (y1 - y0);
      c.keys.push_back(engine() % 50);
    }
    c.projected.rects = ctx().upload({count, 2}, c.rects, Type::u32);
    c.projected.keys = ctx().upload({count}, c.keys, Type::u32);
    c.projected.key_bits = 6;
    return c;
  }

  void check(long count, int tiles_x, int tiles_y) {
    for (const bool slots : {false, true}) {
      SCOPED_TRACE(std::to_string(count) + (slots ? " with slots" : ""));
      const Case c = make(count, tiles_x, tiles_y, static_cast<std::uint32_t>(count));
      std::vector<std::uint32_t> order(c.keys.size());
      std::iota(order.begin(), order.end(), 0u);
      std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return c.keys[a] < c.keys[b]; });
      std::vector<std::uint32_t> ids, starts;
      for (std::uint32_t ty = 0; ty < static_cast<unsigned>(tiles_y); ++ty) {
        for (std::uint32_t tx = 0; tx < static_cast<unsigned>(tiles_x); ++tx) {
          starts.push_back(static_cast<std::uint32_t>(ids.size()));
          for (const std::uint32_t k : order) {
            const std::uint32_t x = c.rects[2 * k], y = c.rects[2 * k + 1];
            if (tx >= (x & 0xffff) && tx < x >> 16 && ty >= (y & 0xffff) && ty < y >> 16) ids.push_back(k);
          }
        }
      }
      starts.push_back(static_cast<std::uint32_t>(ids.size()));
      ASSERT_EQ(c.pairs, ids.size());
      const Binned got = tile_bin(ctx(), c.projected, c.pairs, {3, 5, 3 + tiles_x, 5 + tiles_y}, {slots, false});
      EXPECT_EQ(ctx().read<std::uint32_t>(got.ids), ids);
      EXPECT_EQ(ctx().read<std::uint32_t>(got.starts), starts);
      if (slots) check_slots(c, ids, got);
    }
  }

  // Gaussian by Gaussian, each tile in turn: offsets are the runs' places, and slots lead there, each to another one.
  void check_slots(const Case& c, const std::vector<std::uint32_t>& ids, const Binned& got) {
    const auto offsets = ctx().read<std::uint32_t>(got.offsets), slots = ctx().read<std::uint32_t>(got.slots);
    std::uint32_t before = 0;
    for (std::size_t k = 0; k < c.keys.size(); ++k) {
      EXPECT_EQ(offsets[k], before);
      before += ((c.rects[2 * k] >> 16) - (c.rects[2 * k] & 0xffff)) *
                ((c.rects[2 * k + 1] >> 16) - (c.rects[2 * k + 1] & 0xffff));
    }
    EXPECT_EQ(offsets.back(), before);
    std::vector<std::uint32_t> next(offsets.begin(), offsets.end());  // tiles come in each Gaussian's own order
    for (std::size_t i = 0; i < ids.size(); ++i) EXPECT_EQ(slots[i], next[ids[i]]++);
  }
};

TEST_P(TileBin, MatchesReference) {
  for (const long count : {0L, 1L, 3L, 7L, 63L, 64L, 65L, 1500L}) {
    check(count, 13, 9);
    check(count, 1, 1);  // one tile: no bit to sort by
  }
  check(500, 3, 2);
  check(9000, 40, 30);  // several blocks
}

// With the exact test a tile is left out exactly where no pixel of it, anywhere on it, has alpha >= 1/255.
TEST_P(TileBin, LeavesOutTilesThatAreNotReached) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> uniform;
  const long count = 300;
  const int tiles_x = 30, tiles_y = 20;
  const Part part{2, 1, 2 + tiles_x, 1 + tiles_y};
  std::vector<float> records;
  Case c;
  for (long i = 0; i < count; ++i) {  // blobs and long, thin, slanted ones
    const float u = 16 * (2 + tiles_x * uniform(engine)), v = 16 * (1 + tiles_y * uniform(engine));
    const float a = std::pow(10.0f, 4 * uniform(engine) - 0.5f), d = 0.3f + 30 * uniform(engine) * uniform(engine);
    const float k = 4 * uniform(engine) - 2, lo = -8 * uniform(engine), log2e = 1.4426950409f;
    for (const float f : {u, v, 0.0f, 1.0f, lo, k, -0.5f * log2e / a, -0.5f * log2e / d, 0.0f, 0.0f, 0.0f, 0.0f})
      records.push_back(f);
    const std::uint32_t w = i % 3 == 0 ? static_cast<unsigned>(tiles_x) : 2,
                        h = i % 3 == 0 ? static_cast<unsigned>(tiles_y) : 2;
    const std::uint32_t x0 = w == 2 ? std::min(static_cast<unsigned>(u / 16) - 2, tiles_x - 2u) : 0;
    const std::uint32_t y0 = h == 2 ? std::min(static_cast<unsigned>(v / 16) - 1, tiles_y - 2u) : 0;
    c.rects.push_back(x0 | (x0 + w) << 16);
    c.rects.push_back(y0 | (y0 + h) << 16);
    c.pairs += std::uint64_t{w} * h;
    c.keys.push_back(engine() % 50);
  }
  c.projected.rects = ctx().upload({count, 2}, c.rects, Type::u32);
  c.projected.keys = ctx().upload({count}, c.keys, Type::u32);
  c.projected.records = ctx().upload({count, 12}, records);
  c.projected.key_bits = 6;
  const Binned box = tile_bin(ctx(), c.projected, c.pairs, part, {false, false});
  const auto box_ids = ctx().read<std::uint32_t>(box.ids), box_starts = ctx().read<std::uint32_t>(box.starts);
  ctx().write(c.projected.keys, c.keys.data());
  const Binned exact = tile_bin(ctx(), c.projected, c.pairs, part, {true, true});
  const auto ids = ctx().read<std::uint32_t>(exact.ids), starts = ctx().read<std::uint32_t>(exact.starts);
  const auto slots = ctx().read<std::uint32_t>(exact.slots), offsets = ctx().read<std::uint32_t>(exact.offsets);
  // The largest alpha on the square of a tile's pixel centres, on a grid of them finer than pixels.
  const auto reached = [&](std::uint32_t id, int tile) {
    const float* r = &records[12 * std::size_t{id}];
    const int column = part.x0 + tile % tiles_x, row = part.y0 + tile / tiles_x;
    const double x0 = 16 * column + 0.5, y0 = 16 * row + 0.5;
    double most = -1e30;
    for (int y = 0; y <= 60; ++y)
      for (int x = 0; x <= 60; ++x) {
        const double dx = r[0] - (x0 + x / 4.0), t = r[1] - (y0 + y / 4.0) - r[5] * dx;
        most = std::max(most, r[4] + r[6] * dx * dx + r[7] * t * t);
      }
    return most + std::log2(255.0);
  };
  std::size_t dropped = 0, kept_square = 0;
  for (int tile = 0; tile < tiles_x * tiles_y; ++tile) {
    const std::size_t t = static_cast<std::size_t>(tile);
    std::uint32_t at = starts[t];
    for (std::uint32_t i = box_starts[t]; i < box_starts[t + 1]; ++i) {
      const bool kept = at < starts[t + 1] && ids[at] == box_ids[i];
      at += kept;
      dropped += !kept;
      const std::uint32_t id = box_ids[i];
      const double room = reached(id, tile);
      EXPECT_TRUE(kept || room < 0) << id << " in tile " << tile << ": " << room;
      const bool small = kept && id % 3 != 0;  // these have a bit per tile: no tile clearly not reached is kept
      kept_square += small;
      EXPECT_TRUE(!small || room > -1.0) << id << " in tile " << tile << ": " << room;
    }
    EXPECT_EQ(at, starts[t + 1]);
  }
  EXPECT_GT(dropped, c.pairs / 10);
  EXPECT_GT(kept_square, 50u);
  std::vector<std::uint32_t> next(offsets.begin(), offsets.end());
  for (std::size_t i = 0; i < starts.back(); ++i) EXPECT_EQ(slots[i], next[ids[i]]++);
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) EXPECT_EQ(next[k], offsets[k + 1]);
}

TEST_P(TileBin, RefusesWhatCannotBeSorted) {
  const Case c = make(3, 2, 2, 1);
  try {
    tile_bin(ctx(), c.projected, std::uint64_t{1} << 31, {0, 0, 2, 2});
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), Status::memory);
    EXPECT_NE(std::string(e.what()).find("2147483648 times"), std::string::npos) << e.what();
  }
}

VSPLAT_FLAVOURS(TileBin);
VSPLAT_OPERATION(TileBin, tile_bin)

}  // namespace
}  // namespace vsplat

#include "model/ops/tile_bin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "tests/support/device.h"

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
      const Binned got = tile_bin(ctx(), c.projected, c.pairs, {3, 5, 3 + tiles_x, 5 + tiles_y}, slots);
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

}  // namespace
}  // namespace vsplat

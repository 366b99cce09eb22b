#include "model/ops/tile_bin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/support/device.h"

namespace vsplat {
namespace {

class TileBin : public test::FlavourTest {
 protected:
  struct Case {
    std::vector<std::uint32_t> rects, counts, keys;
    Projected projected;
  };

  // `count` Gaussians on random rectangles of tiles, one in four culled, depths of which many are equal.
  Case make(long count, int tiles_x, int tiles_y, std::uint32_t seed) {
    std::mt19937 engine(seed);
    Case c;
    for (long k = 0; k < count; ++k) {
      std::uint32_t x0 = engine() % static_cast<unsigned>(tiles_x), x1 = engine() % static_cast<unsigned>(tiles_x);
      std::uint32_t y0 = engine() % static_cast<unsigned>(tiles_y), y1 = engine() % static_cast<unsigned>(tiles_y);
      if (x0 > x1) std::swap(x0, x1);
      if (y0 > y1) std::swap(y0, y1);
      x1 = std::min(x1 + 1, x0 + 4);
      y1 = std::min(y1 + 1, y0 + 3);
      const bool culled = engine() % 4 == 0;
      c.rects.push_back(culled ? 0xdeadbeef : x0 | x1 << 16);
      c.rects.push_back(culled ? 0xdeadbeef : y0 | y1 << 16);
      c.counts.push_back(culled ? 0 : (x1 - x0) * (y1 - y0));
      c.keys.push_back(culled ? 0xffffffffu : 0x3f000000u + engine() % 50);
    }
    c.projected.rects = ctx().upload({count, 2}, c.rects, Type::u32);
    c.projected.counts = ctx().upload({count}, c.counts, Type::u32);
    c.projected.keys = ctx().upload({count}, c.keys, Type::u32);
    return c;
  }

  void check(long count, int width, int height) {
    const int tiles_x = (width + 15) / 16, tiles_y = (height + 15) / 16;
    const Case c = make(count, tiles_x, tiles_y, static_cast<std::uint32_t>(count));
    std::vector<std::uint32_t> order;
    for (std::uint32_t k = 0; k < c.counts.size(); ++k) order.push_back(k);
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return c.keys[a] < c.keys[b]; });
    std::vector<std::uint32_t> ids, starts;
    for (std::uint32_t ty = 0; ty < static_cast<unsigned>(tiles_y); ++ty) {
      for (std::uint32_t tx = 0; tx < static_cast<unsigned>(tiles_x); ++tx) {
        starts.push_back(static_cast<std::uint32_t>(ids.size()));
        for (const std::uint32_t k : order) {
          const std::uint32_t x = c.rects[2 * k], y = c.rects[2 * k + 1];
          if (c.counts[k] && tx >= (x & 0xffff) && tx < x >> 16 && ty >= (y & 0xffff) && ty < y >> 16) ids.push_back(k);
        }
      }
    }
    starts.push_back(static_cast<std::uint32_t>(ids.size()));
    const std::uint64_t n = count_intersections(ctx(), c.projected);
    ASSERT_EQ(n, ids.size());
    const Binned got = tile_bin(ctx(), c.projected, n, width, height);
    EXPECT_EQ(ctx().read<std::uint32_t>(got.ids), ids);
    EXPECT_EQ(ctx().read<std::uint32_t>(got.starts), starts);
  }
};

TEST_P(TileBin, MatchesReference) {
  for (const long count : {0L, 1L, 3L, 7L, 63L, 64L, 65L, 1500L}) {
    check(count, 200, 130);
    check(count, 16, 16);  // one tile: no bit to sort by
  }
  check(500, 33, 17);
  check(500, 1, 1);
}

TEST_P(TileBin, CountsBeyond32Bits) {
  const long k = 3000;
  Projected p;
  p.counts = ctx().upload({k}, std::vector<std::uint32_t>(static_cast<std::size_t>(k), 4000000000u), Type::u32);
  EXPECT_EQ(count_intersections(ctx(), p), 12000000000000u);
}

TEST_P(TileBin, RefusesWhatCannotBeSorted) {
  const Case c = make(3, 2, 2, 1);
  try {
    tile_bin(ctx(), c.projected, std::uint64_t{1} << 31, 32, 32);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), Status::memory);
    EXPECT_NE(std::string(e.what()).find("2147483648 times"), std::string::npos) << e.what();
  }
}

VSPLAT_FLAVOURS(TileBin);

}  // namespace
}  // namespace vsplat

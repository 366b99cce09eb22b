#include "model/ops/render/tile_bin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
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
};

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

#include "model/ops/render/visible.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class VisibleOp : public test::FlavourTest {
 protected:
  struct Case {
    std::vector<std::uint32_t> rects, keys;
    Culled culled;
  };

  // Random rectangles within 60 x 40 tiles, one in four culled.
  Case make(long count) {
    std::mt19937 engine(static_cast<unsigned>(count));
    Case c;
    for (long k = 0; k < count; ++k) {
      const std::uint32_t x = engine() % 60, y = engine() % 40, w = 1 + engine() % 5, h = 1 + engine() % 4;
      const bool culled = engine() % 4 == 0;
      c.rects.push_back(culled ? 0 : x | std::min(x + w, 60u) << 16);
      c.rects.push_back(culled ? 0 : y | std::min(y + h, 40u) << 16);
      c.keys.push_back(0x3f800000u + engine() % 100000);
    }
    c.culled = make_culled(ctx(), count);
    ctx().write(c.culled.rects, c.rects.data());
    ctx().write(c.culled.keys, c.keys.data());
    return c;
  }

  void check(const Case& c, const Part& part) {
    std::vector<std::uint32_t> ids, rects, keys;
    std::uint64_t pairs = 0;
    for (std::uint32_t k = 0; k < c.keys.size(); ++k) {
      const auto word = [&](std::size_t i, int from, int to, int& begin, int& end) {
        begin = std::max(static_cast<int>(c.rects[i] & 0xffff), from) - from;
        end = std::min(static_cast<int>(c.rects[i] >> 16), to) - from;
      };
      int l = 0, r = 0, t = 0, b = 0;
      word(2 * std::size_t{k}, part.x0, part.x1, l, r);
      word(2 * std::size_t{k} + 1, part.y0, part.y1, t, b);
      if (l >= r || t >= b) continue;
      ids.push_back(k);
      rects.push_back(static_cast<unsigned>(l) | static_cast<unsigned>(r) << 16);
      rects.push_back(static_cast<unsigned>(t) | static_cast<unsigned>(b) << 16);
      keys.push_back(c.keys[k]);
      pairs += static_cast<std::uint64_t>(r - l) * static_cast<std::uint64_t>(b - t);
    }
    const std::uint32_t least = keys.empty() ? 0 : *std::min_element(keys.begin(), keys.end());
    const std::uint32_t most = keys.empty() ? 0 : *std::max_element(keys.begin(), keys.end());
    for (std::uint32_t& key : keys) key -= least;
    const VisibleCount count = count_visible(ctx(), c.culled, part);
    EXPECT_EQ(count.gaussians, ids.size());
    EXPECT_EQ(count.intersections, pairs);
    EXPECT_EQ(count.least_key, least);
    EXPECT_EQ(count.largest_key, most);
    for (std::size_t b = 0; b < count.before.size(); ++b) {
      const auto end = std::lower_bound(ids.begin(), ids.end(), b * static_cast<std::size_t>(count.block));
      EXPECT_EQ(count.before[b], static_cast<std::uint64_t>(end - ids.begin()));
    }
    const Projected got = compact_visible(ctx(), c.culled, part, count);
    EXPECT_EQ(ctx().read<std::uint32_t>(got.ids), ids);
    EXPECT_EQ(ctx().read<std::uint32_t>(got.rects), rects);
    EXPECT_EQ(ctx().read<std::uint32_t>(got.keys), keys);
    EXPECT_EQ(got.key_bits, std::bit_width(most - least));
  }
};

TEST_P(VisibleOp, MatchesReference) {
  for (const long count : {0L, 1L, 3L, 15L, 16L, 17L, 1023L, 1024L, 1025L, 40000L}) {
    SCOPED_TRACE(count);
    const Case c = make(count);
    check(c, {0, 0, 60, 40});
    check(c, {0, 0, 60, 20});
    check(c, {17, 11, 18, 12});
    check(c, {30, 20, 60, 40});
  }
}

// Tiles are counted with 64 bits.
TEST_P(VisibleOp, CountsBeyond32Bits) {
  const long k = 3000;
  Culled culled = make_culled(ctx(), k);
  ctx().write(culled.rects, std::vector<std::uint32_t>(2 * static_cast<std::size_t>(k), 65535u << 16).data());
  ctx().write(culled.keys, std::vector<std::uint32_t>(static_cast<std::size_t>(k), 7u).data());
  const VisibleCount count = count_visible(ctx(), culled, {0, 0, 65535, 65535});
  EXPECT_EQ(count.gaussians, 3000u);
  EXPECT_EQ(count.intersections, 3000ull * 65535 * 65535);
}

VSPLAT_FLAVOURS(VisibleOp);
VSPLAT_OPERATION(VisibleOp, visible)

}  // namespace
}  // namespace vsplat

#include "model/ops/render/visible.h"

#include <algorithm>
#include <bit>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/render/project.h"

namespace vsplat::selftest {
namespace {

void visible_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 15L, 16L, 17L, 1023L, 1024L, 1025L, 40000L}, {0L}))
    for (const Part& part : {Part{0, 0, 60, 40}, Part{0, 0, 60, 20}, Part{17, 11, 18, 12}, Part{30, 20, 60, 40}}) {
      std::mt19937 engine(static_cast<unsigned>(n));
      std::vector<std::uint32_t> rects, keys, ids, within, order;
      std::uint64_t pairs = 0;
      for (std::uint32_t k = 0; k < n; ++k) {
        const std::uint32_t x = engine() % 60, y = engine() % 40, w = 1 + engine() % 5, h = 1 + engine() % 4;
        const bool culled = k > 0 && engine() % 4 == 0;
        rects.push_back(culled ? 0 : x | std::min(x + w, 60u) << 16);
        rects.push_back(culled ? 0 : y | std::min(y + h, 40u) << 16);
        keys.push_back(0x3f800000u + engine() % 100000);
        const auto clipped = [](std::uint32_t r, int from, int to) {
          return std::pair{std::max(static_cast<int>(r & 0xffff), from) - from,
                           std::min(static_cast<int>(r >> 16), to) - from};
        };
        const auto [l, r] = clipped(rects[2 * std::size_t{k}], part.x0, part.x1);
        const auto [t, b] = clipped(rects[2 * std::size_t{k} + 1], part.y0, part.y1);
        if (l >= r || t >= b) continue;
        ids.push_back(k), order.push_back(keys.back());
        within.push_back(static_cast<unsigned>(l) | static_cast<unsigned>(r) << 16);
        within.push_back(static_cast<unsigned>(t) | static_cast<unsigned>(b) << 16);
        pairs += size_of(r - l, b - t);
      }
      const std::uint32_t least = order.empty() ? 0 : *std::min_element(order.begin(), order.end());
      const std::uint32_t most = order.empty() ? 0 : *std::max_element(order.begin(), order.end());
      for (auto& key : order) key -= least;
      const Culled culled = make_culled(c.ctx, n);
      c.ctx.write(culled.rects, rects.data());
      c.ctx.write(culled.keys, keys.data());
      const VisibleCount count = count_visible(c.ctx, culled, part);
      bool right = count.gaussians == ids.size() && count.intersections == pairs && count.least_key == least &&
                   count.largest_key == most;
      for (std::size_t b = 0; b < count.before.size(); ++b)
        right = right && count.before[b] ==
                             static_cast<std::uint64_t>(
                                 std::lower_bound(ids.begin(), ids.end(), b * size_of(count.block)) - ids.begin());
      c.that("counts", right);
      if (!right || (ids.empty() && !c.all)) continue;
      const Projected got = compact_visible(c.ctx, culled, part, count);
      c.equal("indices", got.ids, ids);
      c.equal("tiles", got.rects, within);
      c.equal("depths", got.keys, order);
      if (c.all) c.that("bits of depths", got.key_bits == static_cast<int>(std::bit_width(most - least)));
    }
}

}  // namespace

VSPLAT_CASES(visible, {"visible", visible_all})

}  // namespace vsplat::selftest

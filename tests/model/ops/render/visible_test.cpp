#include "model/ops/render/visible.h"

#include <gtest/gtest.h>

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class VisibleOp : public test::FlavourTest {};

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

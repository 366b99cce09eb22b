#include "model/ops/volume/space_curve.h"

#include <algorithm>

#include "model/diagnose/selftest/reference/space_curve.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SpaceCurve : public test::FlavourTest {};
VSPLAT_FLAVOURS(SpaceCurve);
VSPLAT_OPERATION(SpaceCurve, space_curve)

TEST_P(SpaceCurve, PointsThatAreTooFarApartAreRefused) {
  const Tensor points = ctx().upload({2, 3}, std::vector<float>{0, 0, 0, 70, 0, 0});
  EXPECT_THROW(grid_cells(ctx(), points, 1e-3), Error);
  EXPECT_THROW(grid_cells(ctx(), ctx().upload({2, 3}, std::vector<float>{0, 0, 0, 1e30f, 0, 0}), 1e-3), Error);
  EXPECT_EQ(grid_cells(ctx(), points, 1.1e-3).depth, 16);
  EXPECT_THROW(grid_cells(ctx(), ctx().tensor({0, 3}), 1), Error);
}

// What makes it Hilbert's: every cell has a place of its own, and the cells of neighbouring places touch.
TEST_P(SpaceCurve, HilbertVisitsEveryCellStepByStep) {
  for (const int depth : {1, 2, 3, 4}) {
    std::vector<ref::Cell> cells;
    const int edge = 1 << depth;
    for (int x = 0; x < edge; ++x)
      for (int y = 0; y < edge; ++y)
        for (int z = 0; z < edge; ++z) cells.push_back({x, y, z});
    const Tensor on_device = ctx().upload({static_cast<long>(cells.size()), 3}, cells.data(), Type::i32);
    const auto places = ctx().read<std::uint64_t>(curve_codes(ctx(), {on_device, depth}, Curve::hilbert, false));
    std::vector<int> at(cells.size(), -1);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      ASSERT_LT(places[i], cells.size());
      at[places[i]] = static_cast<int>(i);
    }
    EXPECT_EQ(at[0], 0) << "it begins at the origin";
    for (std::size_t i = 0; i < at.size(); ++i) {
      ASSERT_GE(at[i], 0) << "place " << i << " of depth " << depth;
      if (i == 0) continue;
      int steps = 0;
      for (std::size_t a = 0; a < 3; ++a)
        steps += std::abs(cells[static_cast<std::size_t>(at[i])][a] - cells[static_cast<std::size_t>(at[i - 1])][a]);
      ASSERT_EQ(steps, 1) << "place " << i << " of depth " << depth;
    }
  }
}

}  // namespace
}  // namespace vsplat

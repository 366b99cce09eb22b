#include "model/ops/volume/cell_map.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class CellMap : public test::FlavourTest {};
VSPLAT_FLAVOURS(CellMap);
VSPLAT_OPERATION(CellMap, cell_map)

TEST_P(CellMap, RejectsBadShape) {
  const Tensor cells = ctx().tensor({7, 3}, Type::i32), codes = ctx().tensor({7}, Type::u64),
               points = ctx().tensor({7}, Type::u32), standing = ctx().tensor({7}, Type::i32),
               map = ctx().tensor({7, 27}, Type::i32), few = ctx().tensor({7, 26}, Type::i32);
  EXPECT_THROW(cell_map_forward(ctx(), {{cells, 1}, codes, points, false, standing, few}), Error);
  EXPECT_THROW(cell_map_forward(ctx(), {{cells, 1}, ctx().tensor({6}, Type::u64), points, false, standing, map}),
               Error);
}

}  // namespace
}  // namespace vsplat

#include "model/ops/volume/cell_map.h"

#include "model/diagnose/selftest/reference/cell_map.h"
#include "model/ops/render/radix_sort.h"
#include "model/ops/volume/sparse_conv.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class CellMap : public test::FlavourTest {
 protected:
  // Points in a cube of 2^depth cells along an edge, so few that some share a cell.
  void make(long n, int depth) {
    std::mt19937 engine(static_cast<std::uint32_t>(n + depth));
    cells_.clear();
    for (long i = 0; i < n; ++i) {
      ref::Cell& c = cells_.emplace_back();
      for (int& axis : c) axis = static_cast<int>(engine() % (1u << depth));
    }
    in_.cells = {ctx().upload({n, 3}, cells_.data(), Type::i32), depth};
    const Sorted sorted = radix_sort(ctx(), curve_codes(ctx(), in_.cells, Curve::morton, false), {}, 3 * depth);
    in_.codes = sorted.keys, in_.points = sorted.values;
    const std::vector<int> gaps(static_cast<std::size_t>(27 * n), -7);
    in_.standing = ctx().upload({n}, gaps, Type::i32), in_.map = ctx().upload({n, 27}, gaps, Type::i32);
  }
  std::vector<ref::Cell> cells_;
  CellMapForward in_;
};
VSPLAT_FLAVOURS(CellMap);
VSPLAT_OPERATION(CellMap, cell_map)

TEST_P(CellMap, RejectsBadShape) {
  make(7, 1);
  in_.map = ctx().tensor({7, 26}, Type::i32);
  EXPECT_THROW(cell_map_forward(ctx(), in_), Error);
  in_.map = ctx().tensor({7, 27}, Type::i32);
  in_.codes = ctx().tensor({6}, Type::u64);
  EXPECT_THROW(cell_map_forward(ctx(), in_), Error);
}

}  // namespace
}  // namespace vsplat

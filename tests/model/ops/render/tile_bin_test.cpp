#include "model/ops/render/tile_bin.h"

#include <gtest/gtest.h>

#include "tests/support/operation.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

class TileBin : public test::FlavourTest {};

TEST_P(TileBin, RefusesWhatCannotBeSorted) {
  Projected projected;  // one Gaussian in four tiles
  projected.rects = ctx().upload({1, 2}, std::vector<std::uint32_t>{2u << 16, 2u << 16}, Type::u32);
  projected.keys = ctx().upload({1}, std::vector<std::uint32_t>{0}, Type::u32);
  projected.key_bits = 6;
  test::expect_error(Status::memory, {"2147483648 times"}, [&] {
    tile_bin(ctx(), projected, std::uint64_t{1} << 31, {0, 0, 2, 2});
  });
}

VSPLAT_FLAVOURS(TileBin);
VSPLAT_OPERATION(TileBin, tile_bin)

}  // namespace
}  // namespace vsplat

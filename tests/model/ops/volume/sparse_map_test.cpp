#include "model/ops/volume/sparse_map.h"

#include "model/base/rng.h"
#include "model/diagnose/selftest/reference/sparse_map.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SparseMapOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(SparseMapOp);
VSPLAT_OPERATION(SparseMapOp, sparse_map)

std::vector<int> random_voxels(int r, float share) {
  std::vector<int> index;
  for (int i = 0; i < r * r * r; ++i) {
    if (uniform01(philox4x32_10({static_cast<std::uint32_t>(i), 0, 0, 0}, rng_key(3))[0]) < share) index.push_back(i);
  }
  return index;
}

TEST(SparseMap, MatchesReference) {
  Context& ctx = test::context(Flavour::cpu);
  for (const auto& [r, share] : {std::pair{1, 1.0f}, {2, 1.0f}, {3, 0.5f}, {7, 0.3f}, {8, 1.0f}}) {
    const std::vector<int> index = random_voxels(r, share);
    const long p = static_cast<long>(index.size());
    const Tensor map = ctx.upload({p, 27}, std::vector<int>(index.size() * 27, -99), Type::i32);
    sparse_map_forward(ctx, {ctx.upload({p}, index, Type::i32), r, map});
    EXPECT_EQ(ctx.read<int>(map), ref::sparse_map(index, r)) << r;
  }
}

// Rows need not be in the order of their voxels.
TEST(SparseMap, AnyOrderOfRows) {
  Context& ctx = test::context(Flavour::cpu);
  const std::vector<int> index = {13, 0, 26, 12, 14, 1};
  const Tensor map = ctx.tensor({6, 27}, Type::i32);
  sparse_map_forward(ctx, {ctx.upload({6}, index, Type::i32), 3, map});
  EXPECT_EQ(ctx.read<int>(map), ref::sparse_map(index, 3));
}

TEST(SparseMap, EmptyInput) {
  Context& ctx = test::context(Flavour::cpu);
  sparse_map_forward(ctx, {ctx.tensor({0}, Type::i32), 3, ctx.tensor({0, 27}, Type::i32)});
}

TEST(SparseMap, RejectsBadShape) {
  Context& ctx = test::context(Flavour::cpu);
  EXPECT_THROW(sparse_map_forward(ctx, {ctx.tensor({2}, Type::i32), 3, ctx.tensor({2, 26}, Type::i32)}), Error);
}

}  // namespace
}  // namespace vsplat

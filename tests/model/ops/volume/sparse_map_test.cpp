#include "model/ops/volume/sparse_map.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SparseMapOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(SparseMapOp);
VSPLAT_OPERATION(SparseMapOp, sparse_map)

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

#include "model/ops/fit/sparsity_loss.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SparsityLossTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(SparsityLossTest);
VSPLAT_OPERATION(SparsityLossTest, sparsity_loss)

TEST_P(SparsityLossTest, EmptyAndBadShape) {
  const Tensor none = ctx().tensor({0}), two = ctx().tensor({2});
  EXPECT_NO_THROW(sparsity_loss(ctx(), {none, none, 1}));
  EXPECT_THROW(sparsity_loss(ctx(), {two, ctx().tensor({3}), 1}), Error);
}

}  // namespace
}  // namespace vsplat

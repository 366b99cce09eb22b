#include "model/ops/dense/add_columns.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class AddColumnsOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(AddColumnsOp);
VSPLAT_OPERATION(AddColumnsOp, add_columns)

TEST_P(AddColumnsOp, RejectsBadShape) {
  const Tensor x = ctx().tensor({4, 3});
  EXPECT_THROW(add_columns(ctx(), {x, ctx().tensor({5, 3}), 0}), Error);
  EXPECT_THROW(add_columns(ctx(), {x, ctx().tensor({4, 3}), 1}), Error);
  EXPECT_THROW(add_columns(ctx(), {x, ctx().tensor({4, 5}), -1}), Error);
  EXPECT_THROW(add_columns(ctx(), {x, ctx().tensor({4, 3}), 0, 2, 2}), Error);
  EXPECT_THROW(add_columns(ctx(), {x.reshaped({12}), ctx().tensor({4, 5}), 0}), Error);
}

}  // namespace
}  // namespace vsplat

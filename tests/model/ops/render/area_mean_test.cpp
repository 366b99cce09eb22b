#include "model/ops/render/area_mean.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class AreaMeanOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(AreaMeanOp);
VSPLAT_OPERATION(AreaMeanOp, area_mean)

TEST_P(AreaMeanOp, RejectsBadShape) {
  const Tensor x = ctx().tensor({4, 6, 3});
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({2, 3, 3}), 1}), Error);
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({2, 2, 3}), 2}), Error);
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({2, 3, 1}), 2}), Error);
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({2, 3}), 2}), Error);
  EXPECT_THROW(area_mean(ctx(), {x, ctx().tensor({4, 6, 3}), 0}), Error);
}

}  // namespace
}  // namespace vsplat

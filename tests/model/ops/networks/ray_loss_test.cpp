#include "model/ops/networks/ray_loss.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class RayLossTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(RayLossTest);
VSPLAT_OPERATION(RayLossTest, ray_loss)

TEST_P(RayLossTest, EmptyAndBadShape) {
  const Tensor one = ctx().tensor({1}), none = ctx().tensor({0, 6}), two = ctx().tensor({2, 6});
  EXPECT_THROW(ray_loss(ctx(), {none, none, one, {}}), Error);
  EXPECT_THROW(ray_loss(ctx(), {two, ctx().tensor({3, 6}), one, {}}), Error);
}

}  // namespace
}  // namespace vsplat

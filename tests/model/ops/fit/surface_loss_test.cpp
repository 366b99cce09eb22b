#include "model/ops/fit/surface_loss.h"

#include <gtest/gtest.h>

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SurfaceLossOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(SurfaceLossOp);
VSPLAT_OPERATION(SurfaceLossOp, surface_loss)

// A picture without pixels has no loss.
TEST_P(SurfaceLossOp, NoPixels) {
  SurfaceLoss a;
  a.normal = a.depth_normal = a.dnormal = a.ddepth_normal = ctx().tensor({0, 5, 3});
  a.alpha = a.distortion = a.ddistortion = ctx().tensor({0, 5});
  a.weights = {1, 1};
  a.value = ctx().upload({1}, std::vector<float>{2});
  surface_loss(ctx(), a);
  EXPECT_EQ(ctx().read<float>(a.value), std::vector<float>{2});
}

}  // namespace
}  // namespace vsplat

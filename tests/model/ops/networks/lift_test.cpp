#include "model/ops/networks/lift.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Lift : public test::FlavourTest {};
VSPLAT_FLAVOURS(Lift);
VSPLAT_OPERATION(Lift, lift)

// A voxel's centre in the plane of a camera, and at its centre: 1/0 and 0/0 count as outside.
TEST_P(Lift, DepthZeroIsOutside) {
  Camera camera;
  camera.width = camera.height = 8;
  camera.fx = camera.fy = 8, camera.cx = camera.cy = 4;
  Camera beside = camera;
  beside.w2c(0, 3) = 0.7;
  const std::vector<float> bias = {1, 2, 3};
  const Tensor maps = ctx().upload({32, 3}, test::random_floats(2 * 16 * 3, 1)),
               index = ctx().tensor({1, 2, 4}, Type::i32), weight = ctx().upload({1, 2, 4}, test::nans(8)),
               mean = ctx().upload({1, 3}, test::nans(3)), variance = ctx().upload({1, 3}, test::nans(3));
  lift_corners(ctx(), {upload_cameras(ctx(), {camera, beside}), 1, 4, 8, true, 0, index, weight});
  lift_variance_forward(ctx(), {maps, index, weight, variance});
  lift_mean_forward(ctx(), {maps, index, weight, ctx().upload({3}, bias), 0, mean});
  EXPECT_EQ(ctx().read<float>(mean), bias);
  EXPECT_EQ(ctx().read<float>(variance), (std::vector<float>{0, 0, 0}));
}

TEST_P(Lift, RejectsBadShape) {
  const Tensor maps = ctx().tensor({8, 4}), index = ctx().tensor({5, 2, 4}, Type::i32);
  const Tensor weight = ctx().tensor({5, 2, 4}), bias = ctx().tensor({4}), out = ctx().tensor({5, 4});
  EXPECT_THROW(lift_variance_forward(ctx(), {maps, index, ctx().tensor({5, 3, 4}), out}), Error);
  EXPECT_THROW(lift_variance_forward(ctx(), {maps, weight, weight, out}), Error);
  EXPECT_THROW(lift_mean_forward(ctx(), {maps, index, weight, bias, 1, out}), Error);
  EXPECT_THROW(lift_samples_forward(ctx(), {maps, index, weight, out}), Error);
  const ScatterPlan plan = make_scatter_plan(ctx(), ctx().upload({5, 2, 4}, std::vector<int>(40, 1), Type::i32),
                                             ctx().upload({5, 2, 4}, std::vector<float>(40, 1.0f)), 8);
  EXPECT_THROW(lift_variance_backward(ctx(), {maps, index, weight, &plan, ctx().tensor({4, 4}), maps}), Error);
  EXPECT_THROW(lift_variance_backward(ctx(), {maps, index, weight, &plan, out, out}), Error);
  EXPECT_THROW(lift_mean_backward(ctx(), {2, &plan, out, 1, maps}), Error);
  EXPECT_THROW(lift_samples_backward(ctx(), {&plan, ctx().tensor({4, 2, 4}), maps}), Error);
  EXPECT_THROW(lift_mean_backward(ctx(), {0, &plan, out, 0, maps}), Error);
}

}  // namespace
}  // namespace vsplat

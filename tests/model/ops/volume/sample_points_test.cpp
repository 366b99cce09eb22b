#include "model/ops/volume/sample_points.h"

#include "tests/support/operation.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

class SamplePoints : public test::FlavourTest {};
VSPLAT_FLAVOURS(SamplePoints);
VSPLAT_OPERATION(SamplePoints, sample_points)

TEST_P(SamplePoints, RejectsBadShape) {
  const DeviceCameras cameras = upload_cameras(ctx(), test::orbit(2, 3));
  const Tensor maps = ctx().tensor({2, 3, 3, 8}), points = ctx().tensor({4, 3});
  EXPECT_THROW(sample_points_forward(ctx(), {maps, points, &cameras, true, ctx().tensor({0, 2, 8})}), Error)
      << "4 points, room for none";
  EXPECT_THROW(sample_points_forward(ctx(), {maps, points, &cameras, true, ctx().tensor({4, 3, 8})}), Error)
      << "two views, room for three";
}

}  // namespace
}  // namespace vsplat

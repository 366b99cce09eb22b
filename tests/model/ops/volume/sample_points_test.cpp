#include "model/ops/volume/sample_points.h"

#include "model/diagnose/selftest/reference/sample_points.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

// Points reach `reach` from the middle, along each axis.
ref::SamplePointsCase make_case(long views, long size, long p, bool half_pixel, float reach) {
  ref::SamplePointsCase in;
  in.size = size, in.half_pixel = half_pixel;
  in.cameras = test::orbit(static_cast<int>(views), static_cast<int>(size));
  for (const float x : test::random_floats(static_cast<std::size_t>(views * size * size * 8), 31)) in.maps.push_back(x);
  for (const float x : test::random_floats(static_cast<std::size_t>(3 * p), 32, -reach, reach)) in.points.push_back(x);
  return in;
}

SamplePointsForward upload_sample_points(Context& ctx, const ref::SamplePointsCase& in, const DeviceCameras& cameras) {
  const long v = static_cast<long>(in.cameras.size()), p = static_cast<long>(in.points.size() / 3);
  return {ctx.upload({v, in.size, in.size, 8}, test::as_floats(in.maps)),
          ctx.upload({p, 3}, test::as_floats(in.points)), &cameras, in.half_pixel,
          ctx.upload({p, v, 8}, test::nans(static_cast<std::size_t>(8 * p * v)))};
}

class SamplePoints : public test::FlavourTest {};
VSPLAT_FLAVOURS(SamplePoints);
VSPLAT_OPERATION(SamplePoints, sample_points)

TEST_P(SamplePoints, EmptyAndBadShape) {
  const auto in = make_case(2, 3, 0, true, 1);
  const DeviceCameras cameras = upload_cameras(ctx(), in.cameras);
  SamplePointsForward a = upload_sample_points(ctx(), in, cameras);
  sample_points_forward(ctx(), a);
  const Tensor none = ctx().tensor({0, 2, 8});
  sample_points_backward(ctx(), {a, none, ctx().tensor({0, 3}), a.maps});
  EXPECT_EQ(ctx().read<float>(a.maps), test::as_floats(in.maps)) << "nothing is added";
  a.points = ctx().tensor({4, 3});
  EXPECT_THROW(sample_points_forward(ctx(), a), Error) << "4 points, room for none";
  a.out = ctx().tensor({4, 3, 8});
  EXPECT_THROW(sample_points_forward(ctx(), a), Error) << "two views, room for three";
}

}  // namespace
}  // namespace vsplat

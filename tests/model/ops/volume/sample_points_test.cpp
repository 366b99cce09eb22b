#include "model/ops/volume/sample_points.h"

#include <fmt/format.h>

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

class SamplePoints : public test::FlavourTest {
 protected:
  void check(long views, long size, long p, bool half_pixel, float reach) {
    SCOPED_TRACE(fmt::format("{} views of {}, {} points", views, size, p));
    const auto in = make_case(views, size, p, half_pixel, reach);
    const DeviceCameras cameras = upload_cameras(ctx(), in.cameras);
    const SamplePointsForward a = upload_sample_points(ctx(), in, cameras);
    sample_points_forward(ctx(), a);
    // A pixel's position is exact to about 1e-6 of the picture, and neighbouring pixels differ by up to 2.
    EXPECT_TRUE(test::close_by_channel(ctx().read<float>(a.out), in.all(), 8, 2e-5));

    const auto dout = test::random_floats(static_cast<std::size_t>(8 * views * p), 33);
    const auto before = test::random_floats(static_cast<std::size_t>(3 * p), 34);
    const auto maps_before = test::random_floats(in.maps.size(), 35);
    std::vector<double> by_points = in.points_gradient(dout), by_maps = in.maps_gradient(dout);
    for (std::size_t i = 0; i < before.size(); ++i) by_points[i] += before[i];
    for (std::size_t i = 0; i < maps_before.size(); ++i) by_maps[i] += maps_before[i];
    const Tensor dpoints = ctx().upload({p, 3}, before), dmaps = ctx().upload(a.maps.shape(), maps_before);
    const Tensor d = ctx().upload({p, views, 8}, dout);
    sample_points_backward(ctx(), {a, d, dpoints, dmaps});
    const auto got = ctx().read<float>(dpoints);
    EXPECT_TRUE(test::close(got, by_points, 5e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(dmaps), by_maps, 2e-5));
    ctx().write(dpoints, before.data());
    sample_points_backward(ctx(), {a, d, dpoints, {}});
    EXPECT_EQ(ctx().read<float>(dpoints), got) << "maps that are held";
  }
};
VSPLAT_FLAVOURS(SamplePoints);
VSPLAT_OPERATION(SamplePoints, sample_points)

TEST_P(SamplePoints, MatchesReference) {
  check(1, 1, 1, true, 0.5f);
  check(2, 7, 17, true, 0.5f);
  check(3, 8, 31, false, 0.5f);
  check(4, 5, 65, true, 0.4f);
}

// Many points fall outside the pictures, on their borders, and behind cameras.
TEST_P(SamplePoints, OutsideThePicturesIsZero) { check(3, 5, 150, true, 1.2f); }

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

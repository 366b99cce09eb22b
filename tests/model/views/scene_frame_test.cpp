#include "model/views/scene_frame.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

// Looks along z.
Camera camera_at(const Vector3d& place) {
  Camera out;
  out.width = out.height = 100;
  out.fx = out.fy = 100;
  out.cx = out.cy = 50;
  out.w2c.topRightCorner<3, 1>() = -place;
  return out;
}

std::vector<Camera> ring(int count, double radius, const Vector3d& about = Vector3d::Zero()) {
  std::vector<Camera> out;
  for (int i = 0; i < count; ++i) {
    const double angle = i * 6.283185307179586 / count;
    out.push_back(camera_at(about + radius * Vector3d(std::cos(angle), std::sin(angle), 0)));
  }
  return out;
}

ColoredPoint at(double x, double y, double z) { return {Vector3d(x, y, z), {1, 2, 3}, 0.5, 4}; }

TEST(SceneFrame, TheUnitIsALittleMoreThanTheCamerasReach) {
  const SceneFrame frame = scene_frame(ring(8, 2, {5, 6, 7}), {});
  EXPECT_NEAR((frame.placement.centre - Vector3d(5, 6, 7)).norm(), 0, 1e-12);
  EXPECT_NEAR(frame.placement.edge, 2.2, 1e-12);
  EXPECT_NEAR(frame.near, 0.022, 1e-12);
}

TEST(SceneFrame, AStrayCameraHasNoInfluenceOnTheUnit) {
  std::vector<Camera> cameras = ring(16, 2);
  cameras.push_back(camera_at({0, 0, 1000}));
  EXPECT_LT(scene_frame(cameras, {}).placement.edge, 7);
}

TEST(SceneFrame, FarFromTheOriginItIsAsExact) {
  const SceneFrame frame = scene_frame(ring(8, 2, {1e8, -2e8, 3e8}), {});
  EXPECT_NEAR(frame.placement.edge, 2.2, 1e-6);
  EXPECT_NEAR((frame.placement.centre - Vector3d(1e8, -2e8, 3e8)).norm(), 0, 1e-6);
}

TEST(SceneFrame, TheNearPlaneFollowsTheNearestSeenPoint) {
  std::vector<ColoredPoint> points;
  points.reserve(102);
  for (int i = 0; i < 100; ++i) points.push_back(at(0, 0, 5 + i));
  points.push_back(at(0, 0, -1));    // behind
  points.push_back(at(50, 0, 0.1));  // beside
  EXPECT_NEAR(scene_frame(ring(4, 0.5), points).near, 0.05, 1e-12);
}

TEST(SceneFrame, CamerasAtOnePlaceNeedPoints) {
  const std::vector<Camera> one(3, camera_at({1, 2, 3}));
  test::expect_error(Status::input, {"(1, 2, 3)", "no point"}, [&] { scene_frame(one, {}); });
  EXPECT_NEAR(scene_frame(one, std::vector{at(1, 2, 10), at(1, 2, 13), at(1, 2, 16)}).placement.edge, 10, 1e-12);
  test::expect_error(Status::usage, {"no camera"}, [] { scene_frame({}, {}); });
}

TEST(SceneFrame, PointsThatTheNearPlaneCutsAreReported) {
  std::vector<ColoredPoint> points;
  points.reserve(10);
  for (int i = 0; i < 10; ++i) points.push_back(at(0, 0, 1 + i));
  const std::vector<Camera> cameras = ring(2, 0.1);
  EXPECT_EQ(cut_by_near(cameras, points, 0.5), "");
  EXPECT_NE(cut_by_near(cameras, points, 3.5).find("cuts away 3 of the 10 points"), std::string::npos);
  EXPECT_EQ(cut_by_near(cameras, {}, 3.5), "");
}

}  // namespace
}  // namespace vsplat

#include "model/base/pose_noise.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "model/diagnose/selftest/reference/plucker.h"
#include "tests/support/compare.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

// The exponential, as a series for a 1024th of the step, squared ten times.
Eigen::Matrix4d exponential(const PoseMotion& t) {
  Eigen::Matrix4d a = Eigen::Matrix4d::Zero(), term = Eigen::Matrix4d::Identity(), out = term;
  a << 0, -t[2], t[1], t[3], t[2], 0, -t[0], t[4], -t[1], t[0], 0, t[5], 0, 0, 0, 0;
  for (int i = 1; i < 8; ++i) out += term = term * a / 1024.0 / i;
  for (int i = 0; i < 10; ++i) out = (out * out).eval();
  return out;
}

TEST(PoseNoise, MotionsAreTheMatrixExponential) {
  for (const double sigma : {0.0, 1e-4, 0.01, 0.04, 0.06, 0.15, 1.0})
    for (const PoseMotion& motion : draw_pose_noise(20, sigma, 3, 0, "a"))
      EXPECT_LT((motion_of(motion) - exponential(motion)).norm(), 1e-12) << sigma;
}

TEST(PoseNoise, IsNormalAndTheFirstViewIsExact) {
  double sum = 0, squares = 0;
  int count = 0;
  for (std::uint32_t draw = 0; draw < 300; ++draw) {
    const auto noise = draw_pose_noise(4, 0.1, 7, draw, "cup");
    EXPECT_EQ(noise[0], PoseMotion{});
    for (std::size_t view = 1; view < 4; ++view)
      for (const double x : noise[view]) sum += x, squares += x * x, ++count;
  }
  EXPECT_NEAR(sum / count, 0, 0.005);
  EXPECT_NEAR(std::sqrt(squares / count), 0.1, 0.005);
}

TEST(PoseNoise, FollowsFromSeedDrawAndName) {
  const auto first = draw_pose_noise(4, 0.1, 7, 0, "cup");
  EXPECT_EQ(draw_pose_noise(4, 0.1, 7, 0, "cup"), first);
  EXPECT_NE(draw_pose_noise(4, 0.1, 8, 0, "cup"), first);
  EXPECT_NE(draw_pose_noise(4, 0.1, 7, 1, "cup"), first);
  EXPECT_NE(draw_pose_noise(4, 0.1, 7, 0, "mug"), first);
  EXPECT_EQ(draw_pose_noise(2, 0.1, 7, 0, "cup")[1], first[1]);
}

TEST(PoseNoise, TurnsCamerasAboutTheCentre) {
  const auto cameras = test::orbit(3, 16);
  const PoseMotion turn{0, 0.1, 0, 0, 0, 0}, step{0, 0, 0, 0.01, -0.02, 0.03};
  const auto turned = moved_cameras(cameras, {turn, turn, turn});
  const PoseErrors by_turn = pose_errors(turned, cameras);
  EXPECT_NEAR(by_turn.degrees, 0.1 * 180 / M_PI, 1e-9);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(turned[i].centre().norm(), cameras[i].centre().norm(), 1e-12) << "as far from the object as before";
  EXPECT_GT(by_turn.distance, 0.1);
  const PoseErrors by_step = pose_errors(moved_cameras(cameras, {step, step, step}), cameras);
  EXPECT_NEAR(by_step.degrees, 0, 1e-6);
  EXPECT_NEAR(by_step.distance, std::sqrt(0.0014), 1e-12);
  EXPECT_EQ(pose_errors(cameras, cameras).distance, 0);
}

TEST(PoseNoise, RayErrorsKnowNoLength) {
  const std::vector<float> rays{0, 0, 1, 0.5f, 0, 0, 1, 0, 0, 0, 1, 0};
  std::vector<float> longer = rays;
  for (float& x : longer) x *= 3;
  EXPECT_NEAR(ray_errors(longer, rays).degrees, 0, 1e-6);
  EXPECT_NEAR(ray_errors(longer, rays).moment, 0, 1e-6);
  const RayErrors off = ray_errors({0, 1, 1, 0.5f, 0, 0, 1, 0, 0, 0, 1, 0}, rays);
  EXPECT_NEAR(off.degrees, 22.5, 1e-5);
  EXPECT_NEAR(off.moment, (0.5 - 0.5 / std::sqrt(2)) / 2, 1e-6);
}

TEST(PatchRays, AreDirectionsAndMoments) {
  const auto cameras = test::orbit(2, 24, 2.3);
  const auto got = patch_rays(cameras, 3, 8);
  std::vector<double> want;
  for (const Camera& camera : cameras)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 3; ++x) {
        Eigen::Vector3d d, m;
        ref::plucker(camera, (x + 0.5) * 8, (y + 0.5) * 8, d, m);
        want.insert(want.end(), {d.x(), d.y(), d.z(), m.x(), m.y(), m.z()});
      }
  EXPECT_TRUE(test::close(got, want, 1e-6));
}

}  // namespace
}  // namespace vsplat

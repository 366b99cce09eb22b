#include "model/cameras/orbit.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "model/base/gaussians.h"
#include "model/input/pose_check.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using test::expect_error;

void expect_rigid(const Camera& c) {
  const Eigen::Matrix3d R = c.w2c.topLeftCorner<3, 3>();
  EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(R.determinant(), 1, 1e-12);
}

double elevation(const Camera& c, const Vector3d& centre, const Vector3d& up) {
  return std::asin((c.centre() - centre).normalized().dot(up));
}

TEST(Orbit, TakesWhatTheInputsHave) {
  const Vector3d centre(1, 2, 3), up(0, -1, 0);
  const std::vector<Camera> inputs = test::ring(7, centre, 2.5, 0.4);
  const std::vector<Camera> orbit = orbit_about(inputs, centre, 8, 512, 384);
  ASSERT_EQ(orbit.size(), 8U);
  EXPECT_LT((orbit[0].centre() - inputs[0].centre()).norm(), 1e-9);
  for (const Camera& c : orbit) {
    expect_rigid(c);
    EXPECT_EQ(c.width, 512);
    EXPECT_EQ(c.height, 384);
    EXPECT_NEAR((c.centre() - centre).norm(), 2.5, 1e-12);
    EXPECT_NEAR(elevation(c, centre, up), 0.4, 1e-9);
    EXPECT_LT((*project_to_picture(c, centre) - Eigen::Vector2d(256, 192)).norm(), 1e-9);
    EXPECT_LT((*project_to_picture(c, centre + 0.1 * up)).y(), 192);
    EXPECT_NEAR(c.fx / 384, 790.0 / 480, 1e-12);  // the narrower field of view stays
    EXPECT_EQ(c.fx, c.fy);
  }
  for (int i = 0; i < 8; ++i) {  // evenly, counter-clockwise seen from above
    const Vector3d a = orbit[i].centre() - centre, b = orbit[(i + 1) % 8].centre() - centre;
    EXPECT_NEAR((a - a.dot(up) * up).normalized().cross((b - b.dot(up) * up).normalized()).dot(up), std::sin(M_PI / 4),
                1e-9);
  }
}

TEST(Orbit, MovesWithTheRig) {
  const std::vector<Camera> inputs = test::ring(5, {0, 0, 0}, 2, 0.3, 8);
  Eigen::Isometry3d motion = Eigen::Translation3d(3, -1, 2) * Eigen::AngleAxisd(1.2, Vector3d(1, -2, 0.5).normalized());
  std::vector<Camera> moved = inputs;
  for (Camera& c : moved) c.w2c = c.w2c * motion.inverse().matrix();
  const auto a = orbit_about(inputs, {0, 0, 0}, 5, 64, 64),
             b = orbit_about(moved, motion * Vector3d::Zero(), 5, 64, 64);
  for (int i = 0; i < 5; ++i) EXPECT_LT((a[i].w2c - b[i].w2c * motion.matrix()).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Orbit, OptionsWin) {
  const std::vector<Camera> inputs = test::ring(4);
  const auto orbit =
      orbit_about(inputs, {0, 0, 0}, 3, 64, 64, {.radius = 5, .elevation_deg = -30, .up = Vector3d(0, 0, 2)});
  for (const Camera& c : orbit) {
    EXPECT_NEAR(c.centre().norm(), 5, 1e-12);
    EXPECT_NEAR(elevation(c, {0, 0, 0}, {0, 0, 1}), -M_PI / 6, 1e-12);
  }
  const auto bad = [&](OrbitOptions options) {
    return [&inputs, options] { orbit_about(inputs, {0, 0, 0}, 3, 64, 64, options); };
  };
  expect_error(Status::usage, {"vsplat_orbit_options.radius"}, bad({.radius = 0, .elevation_deg = {}, .up = {}}));
  expect_error(Status::usage, {"vsplat_orbit_options.elevation"}, bad({.radius = {}, .elevation_deg = 91, .up = {}}));
  expect_error(Status::usage, {"vsplat_orbit_options.up"},
               bad({.radius = {}, .elevation_deg = {}, .up = Vector3d(0, 0, 0)}));
  expect_error(Status::usage, {"no camera"}, [] { orbit_about({}, {0, 0, 0}, 3, 64, 64); });
}

TEST(Orbit, StraightFromAbove) {
  for (const double degrees : {90.0, -90.0}) {
    const auto orbit =
        orbit_about(test::ring(4), {0, 0, 0}, 4, 64, 64, {.radius = {}, .elevation_deg = degrees, .up = {}});
    for (const Camera& c : orbit) {
      expect_rigid(c);
      EXPECT_LT((c.centre() - Vector3d(0, degrees > 0 ? -2 : 2, 0)).norm(), 1e-9);
    }
    EXPECT_GT((orbit[0].w2c - orbit[1].w2c).norm(), 0.5);  // the picture turns
  }
  std::vector<Camera> above = test::ring(2);  // inputs that look down
  for (Camera& c : above) c.w2c = look_at({0, -3, 0}, {0, 0, 0}, {0, 0, 1});
  for (const Camera& c :
       orbit_about(above, {0, 0, 0}, 3, 64, 64, {.radius = {}, .elevation_deg = {}, .up = Vector3d(0, -1, 0)}))
    expect_rigid(c);
}

TEST(UpAxis, OfFewViewsFromAboveIsNotTilted) {
  std::vector<Camera> cameras = test::ring(12, {0, 0, 0}, 2, 0.8);
  cameras.resize(3);  // a quarter of the circle only
  EXPECT_LT((up_axis(cameras) - Vector3d(0, -1, 0)).norm(), 0.01);
  EXPECT_LT((up_axis({cameras.data(), 1}) + cameras[0].w2c.row(1).head<3>().transpose()).norm(),
            1e-9);  // of one: its own
}

TEST(UpAxis, OneTurnedByAQuarterCountsLittle) {
  std::vector<Camera> cameras = test::ring(9, {0, 0, 0}, 2, 0.3);
  const Eigen::Matrix3d quarter = Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitZ()).toRotationMatrix();
  cameras[4].w2c.topRows<3>() = quarter * cameras[4].w2c.topRows<3>().eval();
  EXPECT_LT((up_axis(cameras) - Vector3d(0, -1, 0)).norm(), 0.05);
}

TEST(UpAxis, OfCamerasRolledEveryWayIsAcrossTheirPlane) {
  std::vector<Camera> cameras = test::ring(8, {0, 0, 0}, 2, 0);
  for (int i = 1; i < 8; i += 2) {
    const Eigen::Matrix3d half = Eigen::AngleAxisd(M_PI, Vector3d::UnitZ()).toRotationMatrix();
    cameras[i].w2c.topRows<3>() = half * cameras[i].w2c.topRows<3>().eval();
  }
  EXPECT_NEAR(std::abs(up_axis(cameras).y()), 1, 1e-9);
}

TEST(LookAt, AlongUpOrFromThePlaceItself) {
  Camera c;
  for (const Vector3d& target : {Vector3d(0, 5, 0), Vector3d(0, -5, 0), Vector3d(0, 0, 0), Vector3d(1, 2, 3)}) {
    c.w2c = look_at({0, 0, 0}, target, {0, -1, 0});
    expect_rigid(c);
    EXPECT_NEAR((c.w2c * target.homogeneous()).z(), target.norm(), 1e-12);
  }
}

TEST(OrbitAboutScene, MostGaussiansFillThePicture) {
  Gaussians scene;
  unsigned random = 3;
  scene.count = 2001;
  for (std::size_t i = 0; i < 3 * scene.count; ++i) {
    random = random * 1664525U + 1013904223U;
    scene.means.push_back(10.0F + 4 * static_cast<float>(random >> 8) / 16777216.0F);
  }
  for (int i = 0; i < 40; ++i) scene.means[3 * i] = i % 2 ? 1e6F : std::nanf("");  // strays
  const auto orbit = orbit_about_scene(scene, 6, 300, 200);
  ASSERT_EQ(orbit.size(), 6U);
  EXPECT_NEAR(orbit[0].fx, 100 / std::tan(25 * M_PI / 180), 1e-9);
  EXPECT_LT(orbit[0].centre().z(), 10);  // starts in front: -z
  for (const Camera& c : orbit) {
    expect_rigid(c);
    EXPECT_NEAR(c.centre().y(), 12, 0.1);  // level
    int inside = 0;
    double reach = 0;
    for (std::size_t i = 0; i < scene.count; ++i) {
      const auto at = project_to_picture(c, {scene.means[3 * i], scene.means[3 * i + 1], scene.means[3 * i + 2]});
      const bool in = at && at->x() >= 50 && at->x() <= 250 && at->y() >= 0 && at->y() <= 200;
      inside += in;
      if (in) reach = std::max(reach, std::abs(at->y() - 100));
    }
    EXPECT_GT(inside, 0.94 * 2001);
    EXPECT_GT(reach, 75);
  }
}

TEST(OrbitAboutScene, NoneOrOneGaussian) {
  EXPECT_EQ(orbit_about_scene(Gaussians(), 4, 64, 64).size(), 4U);
  Gaussians one;
  one.count = 1;
  one.means = {1, 2, 3};
  for (const Camera& c : orbit_about_scene(one, 4, 64, 64))
    EXPECT_NEAR((c.centre() - Vector3d(1, 2, 3)).norm(), 1, 1e-6);
  for (const Camera& c : orbit_about_scene(one, 4, 64, 64, {.radius = 3, .elevation_deg = 20, .up = Vector3d(0, 0, 1)}))
    EXPECT_NEAR(c.centre().z(), 3 + 3 * std::sin(20 * M_PI / 180), 1e-6);
}

}  // namespace
}  // namespace vsplat

#include "model/views/orbit.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <limits>

#include "model/base/scene.h"
#include "model/views/pose_check.h"
#include "tests/support/posed_views.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using test::expect_error;

void expect_rotation(const Camera& c) {
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
    expect_rotation(c);
    EXPECT_EQ(c.width, 512);
    EXPECT_EQ(c.height, 384);
    EXPECT_NEAR((c.centre() - centre).norm(), 2.5, 1e-12);
    EXPECT_NEAR(elevation(c, centre, up), 0.4, 1e-9);
    EXPECT_LT((*project_to_picture(c, centre) - Eigen::Vector2d(256, 192)).norm(), 1e-9);
    EXPECT_LT((*project_to_picture(c, centre + 0.1 * up)).y(), 192);
    EXPECT_NEAR(c.fx / 384, 790.0 / 480, 1e-12);  // the narrower field of view is kept
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
  expect_error(Status::usage, {"orbit_radius is"}, bad({.radius = 0, .elevation_deg = {}, .up = {}}));
  expect_error(Status::usage, {"orbit_elevation is"}, bad({.radius = {}, .elevation_deg = 91, .up = {}}));
  expect_error(Status::usage, {"up is no direction"},
               bad({.radius = {}, .elevation_deg = {}, .up = Vector3d(0, 0, 0)}));
  expect_error(Status::usage, {"no camera"}, [] { orbit_about({}, {0, 0, 0}, 3, 64, 64); });
}

TEST(Orbit, StraightFromAbove) {
  for (const double degrees : {90.0, -90.0}) {
    const auto orbit =
        orbit_about(test::ring(4), {0, 0, 0}, 4, 64, 64, {.radius = {}, .elevation_deg = degrees, .up = {}});
    for (const Camera& c : orbit) {
      expect_rotation(c);
      EXPECT_LT((c.centre() - Vector3d(0, degrees > 0 ? -2 : 2, 0)).norm(), 1e-9);
    }
    EXPECT_GT((orbit[0].w2c - orbit[1].w2c).norm(), 0.5);  // the picture turns
  }
  std::vector<Camera> above = test::ring(2);  // inputs that look down
  for (Camera& c : above) c.w2c = look_at({0, -3, 0}, {0, 0, 0}, {0, 0, 1});
  for (const Camera& c :
       orbit_about(above, {0, 0, 0}, 3, 64, 64, {.radius = {}, .elevation_deg = {}, .up = Vector3d(0, -1, 0)}))
    expect_rotation(c);
}

TEST(UpAxis, OfFewViewsFromAboveIsNotTilted) {
  std::vector<Camera> cameras = test::ring(12, {0, 0, 0}, 2, 0.8);
  cameras.resize(3);  // a quarter of the circle only
  EXPECT_LT((up_axis(cameras) - Vector3d(0, -1, 0)).norm(), 0.01);
  EXPECT_LT((up_axis({cameras.data(), 1}) + cameras[0].w2c.row(1).head<3>().transpose()).norm(),
            1e-9);  // for a single camera its own
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
    expect_rotation(c);
    EXPECT_NEAR((c.w2c * target.homogeneous()).z(), target.norm(), 1e-12);
  }
}

// Cameras on a ring about `up`, each rolled by one of `rolls` in degrees.
std::vector<Camera> rolled(int count, const Vector3d& up, const std::vector<double>& rolls) {
  std::vector<Camera> out = test::ring(count, {0, 0, 0}, 2, 0.5);
  const Eigen::Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(Vector3d(0, -1, 0), up).toRotationMatrix();
  for (int i = 0; i < count; ++i) {
    Eigen::Matrix4d motion = Eigen::Matrix4d::Identity(), roll = motion;
    motion.topLeftCorner<3, 3>() = turn.transpose();
    roll.topLeftCorner<3, 3>() =
        Eigen::AngleAxisd(rolls[i % rolls.size()] * M_PI / 180, Vector3d::UnitZ()).toRotationMatrix();
    out[i].w2c = roll * out[i].w2c * motion;
  }
  return out;
}

TEST(WorldUp, IsTheWorldsAxisWhereTheCamerasLeaveItOpen) {
  const auto tilted = [](double degrees) {
    return Vector3d(0, std::sin(degrees * M_PI / 180), std::cos(degrees * M_PI / 180));
  };
  EXPECT_EQ(world_up(rolled(8, tilted(2), {0})), Vector3d::UnitZ());  // within the tolerance of a hand-held camera
  EXPECT_LT((world_up(rolled(8, tilted(8), {0})) - tilted(8)).norm(), 1e-3);
  EXPECT_EQ(world_up(rolled(8, tilted(8), {12, -12})), Vector3d::UnitZ());
  EXPECT_LT((world_up(rolled(8, -tilted(45), {20, -20})) + tilted(45)).norm(), 0.1);  // too far from any axis
}

// An ellipsoid's surface, its longest axis along z, with strays.
Scene tall_scene() {
  Scene out;
  const int n = 3000;
  for (int i = 0; i < n; ++i) {
    const double z = 1 - (2.0 * i + 1) / n, r = std::sqrt(1 - z * z), a = 2.399963229728653 * i;
    for (const double v : {3 + r * std::cos(a), -1 + r * std::sin(a), 5 + 4 * z})
      out.gaussians.means.push_back(static_cast<float>(v));
    out.gaussians.scales.insert(out.gaussians.scales.end(), {0.02f, 0.01f, 0.01f});
    out.gaussians.opacities.push_back(0.9f);
  }
  out.gaussians.count = n;
  return out;
}

TEST(OrbitAboutScene, KeepsAllOfItInThePictureAllTheWayRound) {
  Scene scene = tall_scene();
  for (int i = 0; i < 30; ++i) {  // floaters, and a mist too faint to see
    scene.gaussians.means[3 * (97 * i)] += i % 3 ? 1e4F : 0.0F;
    scene.gaussians.means[3 * (97 * i) + 1] -= i % 3 ? 0.0F : 30.0F;
    if (i % 3 == 0) scene.gaussians.opacities[97 * i] = 0.02F;
  }
  for (const Vector3d& up : {Vector3d(0, 0, 1), Vector3d(0, -1, 0)})
    for (const double elevation : {0.0, 35.0, -80.0})
      for (const auto& [width, height] : {std::pair(300, 200), std::pair(200, 300)}) {
        const auto orbit =
            orbit_about_scene(scene, 12, width, height, {.radius = {}, .elevation_deg = elevation, .up = up});
        double edge = std::numeric_limits<double>::infinity();
        for (const Camera& c : orbit)
          for (std::size_t i = 0; i < scene.gaussians.count; ++i) {
            if (i % 97 == 0 && i < std::size_t{97 * 30}) continue;
            const float* m = &scene.gaussians.means[3 * i];
            const auto at = project_to_picture(c, {m[0], m[1], m[2]});
            ASSERT_TRUE(at);
            edge = std::min({edge, at->x() / width, 1 - at->x() / width, at->y() / height, 1 - at->y() / height});
          }
        EXPECT_GT(edge, 0.04) << up.transpose() << ", " << elevation << ", " << width;
        EXPECT_LT(edge, 0.12) << up.transpose() << ", " << elevation << ", " << width;
      }
}

TEST(OrbitAboutScene, StandsByFloatersAndTellsOfThem) {
  test::Warnings warnings;
  const auto radius = [](const Scene& scene) {
    const std::vector<Camera> all = orbit_about_scene(scene, 2, 64, 64);
    return 0.5 * (all[0].centre() - all[1].centre()).norm();
  };
  const double want = radius(tall_scene());
  EXPECT_EQ(warnings.text(), "");
  for (const std::size_t share : {30u, 10u, 4u}) {  // one Gaussian in so many
    Scene scene = tall_scene();
    for (std::size_t i = 0; i < scene.gaussians.count; i += share) {
      const float far_off = 1e3F * static_cast<float>(1 + i % 17);
      scene.gaussians.means[3 * i + i % 3] += i % 2 ? far_off : -far_off;
      std::fill_n(&scene.gaussians.scales[3 * i], 3, 1e3F);
    }
    EXPECT_NEAR(radius(scene), want, 0.1 * want) << share;
    ASSERT_EQ(warnings.all.size(), 1U) << share;
    EXPECT_NE(warnings.text().find("lie more than"), std::string::npos) << warnings.text();
    warnings.all.clear();
  }
}

// Whether the sky has fewer Gaussians than the rest or nearly all.
TEST(OrbitAboutScene, GoesRoundWhatASkySurrounds) {
  test::Warnings warnings;
  for (const auto& [every, sky] : {std::pair(1, 500), std::pair(1, 10000), std::pair(50, 10000)}) {
    const Scene all = tall_scene();
    Scene scene;
    Gaussians& g = scene.gaussians;
    const auto add = [&](double x, double y, double z, float scale) {
      for (const double v : {x, y, z}) g.means.push_back(static_cast<float>(v));
      g.scales.insert(g.scales.end(), 3, scale);
      g.opacities.push_back(0.9F);
      ++g.count;
    };
    for (std::size_t k = 0; k < all.gaussians.count; k += static_cast<std::size_t>(every)) {
      const float* m = &all.gaussians.means[3 * k];
      add(m[0], m[1], m[2], 0.02F);
    }
    const auto want = orbit_about_scene(scene, 3, 64, 64);
    for (int i = 0; i < sky; ++i) {
      const double z = 1 - (2.0 * i + 1) / sky, r = std::sqrt(1 - z * z), a = 2.399963229728653 * i;
      add(2 + 1000 * r * std::cos(a), 1 + 1000 * r * std::sin(a), 1000 * z, 35);
    }
    const auto orbit = orbit_about_scene(scene, 3, 64, 64);
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_LT((orbit[i].centre() - want[i].centre()).norm(), 1e-6) << every << ", " << sky;
  }
}

TEST(OrbitAboutScene, UpIsTheOptionsElseTheScenesElseMinusY) {
  Scene scene = tall_scene();
  const auto up_in_picture = [](const Camera& c) { return Vector3d(-c.w2c.row(1).head<3>().transpose()); };
  EXPECT_LT((up_in_picture(orbit_about_scene(scene, 1, 64, 64)[0]) - Vector3d(0, -1, 0)).norm(), 1e-9);
  scene.up = {0, 0, 1};
  const Camera camera = orbit_about_scene(scene, 1, 64, 64)[0];
  EXPECT_LT((up_in_picture(camera) - Vector3d(0, 0, 1)).norm(), 1e-9);
  EXPECT_LT(camera.centre().y(), -2);  // the front of a z-up world
  const Camera asked =
      orbit_about_scene(scene, 1, 64, 64, {.radius = {}, .elevation_deg = {}, .up = Vector3d(0, 2, 0)})[0];
  EXPECT_LT((up_in_picture(asked) - Vector3d(0, 1, 0)).norm(), 1e-9);
  EXPECT_GT(asked.centre().z(), 6);  // the front of a y-up world
  scene.up = {0.01f, 0.99995f, 0};
  EXPECT_GT(orbit_about_scene(scene, 1, 64, 64)[0].centre().z(), 6);  // nearly so: the same front
}

TEST(OrbitAboutScene, IsInTheWorldOfAnOffset) {
  Scene scene = tall_scene();
  const Vector3d here = orbit_about_scene(scene, 3, 64, 64)[1].centre();
  scene.offset = {1e7, -2e7, 3e7};
  EXPECT_LT((orbit_about_scene(scene, 3, 64, 64)[1].centre() - scene.offset - here).norm(), 1e-6);
}

TEST(OrbitAboutScene, NoneOrOneGaussian) {
  EXPECT_EQ(orbit_about_scene(Scene(), 4, 64, 64).size(), 4U);
  Scene one;
  one.gaussians.count = 1;
  one.gaussians.means = {1, 2, 3};
  one.gaussians.scales = {0.1f, 0.1f, 0.1f};
  one.gaussians.opacities = {0.01f};
  for (const Camera& c : orbit_about_scene(one, 4, 64, 64)) {
    const double distance = (c.centre() - Vector3d(1, 2, 3)).norm();
    EXPECT_GT(distance, 0.0);
    EXPECT_TRUE(std::isfinite(distance));
  }
  for (const Camera& c : orbit_about_scene(one, 4, 64, 64, {.radius = 3, .elevation_deg = 20, .up = Vector3d(0, 0, 1)}))
    EXPECT_NEAR(c.centre().z(), 3 + 3 * std::sin(20 * M_PI / 180), 1e-6);
}

// The cylinder inscribed in the cube is in the picture, whatever the inputs' field of view.
TEST(Orbit, TheCubeKeepsAMargin) {
  const std::vector<Camera> inputs = test::ring(6, {0, 0, 0}, 1.5, 0.5);  // a unit cube reaches beyond their pictures
  for (const double edge : {1.0, 0.1}) {
    const auto orbit =
        orbit_about(inputs, {0, 0, 0}, 8, 200, 200, {.radius = {}, .elevation_deg = {}, .up = {}, .edge = edge});
    double least = 1;
    for (const Camera& c : orbit)
      for (int i = 0; i < 64; ++i)
        for (const double y : {-0.5, 0.5}) {
          const Vector3d at(0.5 * std::cos(i * M_PI / 32), y, 0.5 * std::sin(i * M_PI / 32));
          const Eigen::Vector2d p = *project_to_picture(c, edge * at) / 200;
          least = std::min({least, p.x(), p.y(), 1 - p.x(), 1 - p.y()});
        }
    EXPECT_GT(least, 0.049);
    if (edge == 1) {
      EXPECT_LT(least, 0.06);
    } else {
      EXPECT_NEAR(orbit[0].fx / 200, 790.0 / 480, 1e-12);  // wide enough already
    }
  }
}

}  // namespace
}  // namespace vsplat

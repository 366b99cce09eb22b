#include "model/base/scene.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <limits>
#include <random>

#include "model/base/camera.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "runtime/error.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

Eigen::Matrix3d random_rotation(std::mt19937& engine) {
  std::normal_distribution<double> normal;
  return Eigen::Quaterniond(normal(engine), normal(engine), normal(engine), normal(engine))
      .normalized()
      .toRotationMatrix();
}

Eigen::Vector3d random_direction(std::mt19937& engine) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d(normal(engine), normal(engine), normal(engine)).normalized();
}

TEST(ShRotation, ColoursFollowEveryDirection) {
  std::mt19937 engine(1);
  for (int degree = 0; degree <= 3; ++degree) {
    for (int trial = 0; trial < 20; ++trial) {
      const Eigen::Matrix3d rotation = random_rotation(engine);
      const Eigen::MatrixXd turn = sh_rotation(degree, rotation);
      const Eigen::VectorXd c = Eigen::VectorXd::Random(2 * degree + 1), turned = turn * c;
      for (int i = 0; i < 20; ++i) {
        const Eigen::Vector3d d = random_direction(engine), rd = rotation * d;
        const auto at = ref::basis(d, 16), at_rd = ref::basis(rd, 16);
        double before = 0, after = 0;
        for (int m = 0; m < 2 * degree + 1; ++m) {
          before += c[m] * at[static_cast<std::size_t>(degree * degree + m)];
          after += turned[m] * at_rd[static_cast<std::size_t>(degree * degree + m)];
        }
        EXPECT_NEAR(before, after, 1e-13) << "degree " << degree;
      }
      EXPECT_LT(
          (turn * turn.transpose() - Eigen::MatrixXd::Identity(2 * degree + 1, 2 * degree + 1)).cwiseAbs().maxCoeff(),
          1e-13);
    }
  }
}

TEST(Similarity, FromMatrixInverseAndProduct) {
  std::mt19937 engine(2);
  Similarity a, b;
  a.scale = 3;
  a.rotation = random_rotation(engine);
  a.translation = {1, 2, 3};
  b.scale = 0.2;
  b.rotation = random_rotation(engine);
  b.translation = {-4, 0, 1};
  const auto apply = [](const Similarity& s, const Eigen::Vector3d& x) {
    return Eigen::Vector3d(s.scale * (s.rotation * x) + s.translation);
  };
  const Eigen::Vector3d x(0.3, -0.7, 2);
  EXPECT_LT((apply(a * b, x) - apply(a, apply(b, x))).norm(), 1e-13);
  EXPECT_LT((apply(a.inverse(), apply(a, x)) - x).norm(), 1e-13);
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = a.scale * a.rotation;
  m.topRightCorner<3, 1>() = a.translation;
  EXPECT_LT((apply(Similarity::from_matrix(m), x) - apply(a, x)).norm(), 1e-13);
}

TEST(Similarity, RefusesWhatIsNoRotation) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m(0, 0) = -1;
  EXPECT_THROW(Similarity::from_matrix(m), Error);
  m(0, 0) = 2;
  EXPECT_THROW(Similarity::from_matrix(m), Error);
  m(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(Similarity::from_matrix(m), Error);
}

TEST(Transform, IdentityKeepsEveryBit) {
  const Gaussians g = test::make_scene({"", 20, 3, 0, 0, ""}, 1);
  Gaussians moved = g;
  transform(moved, Similarity());
  EXPECT_EQ(moved.means, g.means);
  EXPECT_EQ(moved.scales, g.scales);
  EXPECT_EQ(moved.sh, g.sh);
}

// The covariance of every Gaussian rotates and scales with the frame.
TEST(Transform, CovarianceTurns) {
  std::mt19937 engine(3);
  const Gaussians g = test::make_scene({"", 20, 0, 0, 0, ""}, 2);
  Similarity move;
  move.scale = 0.7;
  move.rotation = random_rotation(engine);
  move.translation = {5, 6, 7};
  Gaussians moved = g;
  transform(moved, move);
  const auto covariance = [](const Gaussians& gs, std::size_t k) {
    const Eigen::Quaterniond q(gs.quats[4 * k], gs.quats[4 * k + 1], gs.quats[4 * k + 2], gs.quats[4 * k + 3]);
    const Eigen::Vector3d s(gs.scales[3 * k], gs.scales[3 * k + 1], gs.scales[3 * k + 2]);
    const Eigen::Matrix3d m = q.normalized().toRotationMatrix() * s.asDiagonal();
    return Eigen::Matrix3d(m * m.transpose());
  };
  for (std::size_t k = 0; k < g.count; ++k) {
    const Eigen::Matrix3d want = move.scale * move.scale * move.rotation * covariance(g, k) * move.rotation.transpose();
    EXPECT_LT((covariance(moved, k) - want).norm(), 1e-6 * want.norm());
  }
}

// Up rotates with the frame; scale and translation do not change it.
TEST(Transform, UpTurns) {
  Similarity move;
  move.scale = 7;
  move.rotation = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  move.translation = {5, 6, 7};
  Scene scene;
  transform(scene, move);
  EXPECT_FALSE(scene.up);
  scene.up = {0, -1, 0};
  transform(scene, move);
  ASSERT_TRUE(scene.up);
  EXPECT_NEAR((*scene.up)[0], 0, 1e-6);
  EXPECT_NEAR((*scene.up)[1], 0, 1e-6);
  EXPECT_NEAR((*scene.up)[2], -1, 1e-6);
}

// The world's origin if floats suffice, else the cube's centre, for any size of cube.
TEST(Offset, IsNothingUntilFloatsDoNotHoldTheWorld) {
  for (const double edge : {1e-3, 1.0, 1e5}) {
    EXPECT_EQ(offset_for(Eigen::Vector3d(1000, -1600, 20) * edge, edge), Eigen::Vector3d::Zero());
    EXPECT_EQ(offset_for(Eigen::Vector3d(1000, -1700, 20) * edge, edge), Eigen::Vector3d(1000, -1700, 20) * edge);
  }
}

// To a distant place in the world and back: the precision of floats in a cube at the origin is kept.
TEST(Offset, KeepsWhatIsFarAway) {
  std::mt19937 engine(5);
  Scene scene;
  scene.gaussians = test::make_scene({"", 20, 1, 0, 0, ""}, 2);
  scene.mirror = {0.1f, 0.2f, 0.3f};
  scene.detail = Detail{{0.3f, 0.2f, 0.1f}, 0.01f};
  Similarity move;
  move.scale = 2;
  move.rotation = random_rotation(engine);
  move.translation = {3e7, -1e7, 2e7};
  Scene moved = scene;
  transform(moved, move, offset_for(move.translation, move.scale));
  EXPECT_EQ(moved.offset, move.translation);
  EXPECT_FLOAT_EQ(moved.detail->pixel, 0.02f);
  for (std::size_t k = 0; k < scene.gaussians.count; ++k) {
    const Eigen::Map<const Eigen::Vector3f> before(&scene.gaussians.means[3 * k]), after(&moved.gaussians.means[3 * k]);
    const Eigen::Vector3d world = moved.offset + after.cast<double>();
    EXPECT_LT((world - move.apply(before.cast<double>())).norm(), 1e-6 * (1 + before.norm()));
  }
  // Relative to another place in the same world, and back.
  Scene elsewhere = moved;
  transform(elsewhere, Similarity(), Eigen::Vector3d(3e7 + 1, -1e7, 2e7));
  EXPECT_NEAR(elsewhere.gaussians.means[0], moved.gaussians.means[0] - 1, 1e-6);
  EXPECT_NEAR((*elsewhere.mirror)[0], (*moved.mirror)[0] - 1, 1e-6);
  transform(elsewhere, move.inverse());
  EXPECT_EQ(elsewhere.offset, Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < scene.gaussians.means.size(); ++i)
    EXPECT_NEAR(elsewhere.gaussians.means[i], scene.gaussians.means[i], 2e-6);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR((*elsewhere.mirror)[i], (*scene.mirror)[i], 1e-6);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(elsewhere.detail->at[i], scene.detail->at[i], 1e-6);
  EXPECT_FLOAT_EQ(elsewhere.detail->pixel, 0.01f);
}

TEST(Offset, CamerasOfTheWorldSeeTheSame) {
  std::mt19937 engine(6);
  Camera near;
  near.w2c.topLeftCorner<3, 3>() = random_rotation(engine);
  near.w2c.topRightCorner<3, 1>() = Eigen::Vector3d(0.1, -0.2, 3);
  Scene scene;
  EXPECT_EQ(in_frame(scene, near).w2c, near.w2c);
  scene.offset = {1e7, -2e7, 3e7};
  Camera far = near;
  far.w2c.topRightCorner<3, 1>() -= near.w2c.topLeftCorner<3, 3>() * scene.offset;
  EXPECT_LT((in_frame(scene, far).w2c - near.w2c).cwiseAbs().maxCoeff(), 1e-7);
}

}  // namespace
}  // namespace vsplat

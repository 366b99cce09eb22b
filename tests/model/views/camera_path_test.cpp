#include "model/views/camera_path.h"

#include <Eigen/Geometry>

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::expect_error;

Matrix3d rotation(const Camera& c) { return c.w2c.topLeftCorner<3, 3>(); }
double angle_between(const Camera& a, const Camera& b) {
  return AngleAxisd(Matrix3d(rotation(a) * rotation(b).transpose())).angle();
}

Camera camera_at(const Vector3d& centre, const Matrix3d& c2w) {
  Camera c;
  c.width = 640, c.height = 480;
  c.fx = 500, c.fy = 520, c.cx = 300, c.cy = 250;
  c.w2c.topLeftCorner<3, 3>() = c2w.transpose();
  c.w2c.topRightCorner<3, 1>() = -c2w.transpose() * centre;
  return c;
}
Camera turned(double degrees, const Vector3d& axis, const Vector3d& centre = Vector3d::Zero()) {
  return camera_at(centre, AngleAxisd(degrees * M_PI / 180, axis.normalized()).toRotationMatrix());
}

void expect_rigid(const Camera& c) {
  EXPECT_LT((rotation(c) * rotation(c).transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(rotation(c).determinant(), 1, 1e-12);
}

void expect_same(const Camera& a, const Camera& b, double tolerance = 0) {
  EXPECT_LE((a.w2c - b.w2c).cwiseAbs().maxCoeff(), tolerance);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_NEAR(a.fx, b.fx, 1000 * tolerance);
  EXPECT_NEAR(a.fy, b.fy, 1000 * tolerance);
  EXPECT_NEAR(a.cx, b.cx, 1000 * tolerance);
  EXPECT_NEAR(a.cy, b.cy, 1000 * tolerance);
}

TEST(CameraPath, PassesThroughTheKeys) {
  // Keys of a ring are equally far apart, so that every eighth camera is a key.
  std::vector<Camera> keys = test::ring(5, Vector3d(1, 2, 3), 2.5, 0.4);
  for (std::size_t i = 0; i < keys.size(); ++i) keys[i].fx *= 1 + 0.1 * i, keys[i].cy += 7 * i;
  const std::vector<Camera> path = camera_path(keys, 33);
  ASSERT_EQ(path.size(), 33U);
  for (std::size_t i = 0; i < keys.size(); ++i) expect_same(path[8 * i], keys[i], 1e-12);
  expect_same(path.front(), keys.front());  // to the bit
  expect_same(path.back(), keys.back());
  EXPECT_EQ(path[7].file, "0007.png");
  for (const Camera& c : path) expect_rigid(c);
}

TEST(CameraPath, PassesThroughKeysAtAnyDistances) {
  const std::vector<Camera> keys = {turned(0, {0, 1, 0}), turned(20, {1, 1, 0}, {0.01, 0, 0}),
                                    turned(90, {0, 1, 1}, {9, 1, 0}), turned(-60, {1, 0, 2}, {9, 1, 4}),
                                    turned(10, {1, 0, 0}, {9, 1, 4})};
  const std::vector<Camera> path = camera_path(keys, 9001);
  double largest = 0, turn = 0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    largest = std::max(largest, (path[i].centre() - path[i - 1].centre()).norm());
    turn = std::max(turn, angle_between(path[i], path[i - 1]));
  }
  EXPECT_LT(largest, 0.01);  // no jump: 13 units in 9000 steps
  EXPECT_LT(turn, 0.005);
  for (const Camera& key : keys) {
    double nearest = 1e9;
    for (const Camera& c : path)
      nearest = std::min(nearest, (c.centre() - key.centre()).norm() + angle_between(c, key));
    EXPECT_LT(nearest, 0.005);
  }
}

// Neither the centre's nor the rotation's velocity jumps at a key: steps of a fine path change by little.
TEST(CameraPath, IsSmoothAtItsKeys) {
  const std::vector<Camera> keys = {turned(0, {0, 1, 0}), turned(40, {1, 1, 0}, {1, 0, 0}),
                                    turned(90, {0, 1, 1}, {1, 3, 0}), turned(-60, {1, 0, 2}, {5, 1, 4})};
  const auto roughness = [&](int count) {
    const std::vector<Camera> path = camera_path(keys, count);
    double worst = 0;
    for (std::size_t i = 2; i < path.size(); ++i) {
      const Vector3d a = path[i].centre() - path[i - 1].centre(), b = path[i - 1].centre() - path[i - 2].centre();
      const Matrix3d p = rotation(path[i]) * rotation(path[i - 1]).transpose(),
                     q = rotation(path[i - 1]) * rotation(path[i - 2]).transpose();
      worst = std::max({worst, (a - b).norm() / b.norm(), (p - q).norm() / (q - Matrix3d::Identity()).norm()});
    }
    return worst;
  };
  EXPECT_LT(roughness(4001), 0.01);
  EXPECT_LT(roughness(8001), 0.55 * roughness(4001));  // and tends to 0, unlike at a kink
}

TEST(CameraPath, TurnsEvenlyBetweenTwoKeys) {
  for (const double degrees : {10.0, 120.0, 179.9, 180.0}) {
    const std::vector<Camera> keys = {turned(25, {1, 2, 3}), turned(25, {1, 2, 3}, {1, 0, 0})};
    std::vector<Camera> two = keys;
    two[1].w2c.topLeftCorner<3, 3>() =
        AngleAxisd(degrees * M_PI / 180, Vector3d(2, -1, 1).normalized()).toRotationMatrix() * rotation(keys[0]);
    const std::vector<Camera> path = camera_path(two, 11);
    for (std::size_t i = 1; i < path.size(); ++i) {
      EXPECT_NEAR(angle_between(path[i], path[i - 1]) * 180 / M_PI, degrees / 10, 1e-6) << degrees;
      EXPECT_NEAR((path[i].centre() - path[i - 1].centre()).norm(), (two[1].centre() - two[0].centre()).norm() / 10,
                  1e-9);
    }
  }
}

TEST(CameraPath, TakesTheShorterArc) {
  const std::vector<Camera> path = camera_path(std::vector<Camera>{turned(170, {0, 1, 0}), turned(-170, {0, 1, 0})}, 5);
  expect_same(path[2], turned(180, {0, 1, 0}), 1e-12);  // and not 0
}

TEST(CameraPath, HalfATurnGoesOneWayWhateverTheRounding) {
  for (const double axis_sign : {1.0, -1.0})
    for (const double off : {-1e-14, 0.0, 1e-14}) {
      const std::vector<Camera> keys = {turned(0, {0, 1, 0}), turned(axis_sign * (180 + off), {0.1, 1, 0.2})};
      const Camera middle = camera_path(keys, 3)[1];
      expect_same(middle, turned(90, {0.1, 1, 0.2}), 1e-9);
    }
}

TEST(CameraPath, OfOneKeyOrOneCamera) {
  const std::vector<Camera> ring = test::ring(3);
  for (const Camera& c : camera_path(std::vector<Camera>{ring[1]}, 4)) expect_same(c, ring[1]);
  const std::vector<Camera> one = camera_path(ring, 1);
  ASSERT_EQ(one.size(), 1U);
  expect_same(one[0], ring[0]);
  const std::vector<Camera> two = camera_path(ring, 2);
  expect_same(two[0], ring[0]);
  expect_same(two[1], ring[2]);
}

TEST(CameraPath, StandsStillBetweenEqualKeys) {
  const std::vector<Camera> ring = test::ring(3);
  for (const Camera& c : camera_path(std::vector<Camera>{ring[1], ring[1]}, 6)) expect_same(c, ring[1], 1e-12);
  const std::vector<Camera> path = camera_path(std::vector<Camera>{ring[0], ring[1], ring[1], ring[2]}, 91);
  for (const Camera& c : path) {
    EXPECT_TRUE(c.w2c.allFinite());
    expect_rigid(c);
  }
  // A quarter of the mean stretch (two of three have a length): the path's time is 1.5 + 0.25 + 1.5.
  int near_key = 0;
  for (const Camera& c : path) near_key += (c.centre() - ring[1].centre()).norm() < 0.3;
  EXPECT_GE(near_key, 7);
}

TEST(CameraPath, ZoomsOnTheSpot) {
  std::vector<Camera> keys = {turned(0, {0, 1, 0}), turned(0, {0, 1, 0})};
  keys[1].fx *= 4, keys[1].fy *= 9, keys[1].cx += 100;
  const Camera middle = camera_path(keys, 3)[1];
  EXPECT_NEAR(middle.fx, 2 * keys[0].fx, 1e-9);  // geometric
  EXPECT_NEAR(middle.fy, 3 * keys[0].fy, 1e-9);
  EXPECT_NEAR(middle.cx, keys[0].cx + 50, 1e-9);
  EXPECT_NEAR(middle.cy, keys[0].cy, 1e-9);
}

TEST(CameraPath, TakesTheFirstKeysSize) {
  std::vector<Camera> keys = test::ring(2);
  keys[1].width = 321, keys[1].height = 241;  // half as many, rounded
  keys[1].fx = 400, keys[1].fy = 395, keys[1].cx = 161, keys[1].cy = 120;
  const std::vector<Camera> path = camera_path(keys, 3);
  for (const Camera& c : path) {
    EXPECT_EQ(c.width, 640);
    EXPECT_EQ(c.height, 480);
  }
  EXPECT_NEAR(path[2].fx, 400 * 640 / 321.0, 1e-9);
  EXPECT_NEAR(path[2].cy, 120 * 480 / 241.0, 1e-9);
  keys[1].width = 480, keys[1].height = 640;
  expect_error(Status::input, {"key camera 1", "480 x 640", "640 x 480"}, [&] { camera_path(keys, 3); });
}

TEST(CameraPath, DropsLensDistortion) {
  std::vector<Camera> keys = test::ring(2);
  keys[0].distortion.model = keys[1].distortion.model = Distortion::Model::opencv;
  for (const Camera& c : camera_path(keys, 3)) EXPECT_EQ(c.distortion.model, Distortion::Model::none);
}

// Four cameras about an object, at different heights and distances: the path goes round, and the object stays in view.
TEST(CameraPath, GoesRoundWhatTheKeysLookAt) {
  const Vector3d middle(3, -1, 2);
  std::vector<Camera> keys = test::ring(4, middle, 2, 0.2);
  const double heights[] = {0.2, 0.9, -0.4, 0.5}, distances[] = {2, 3, 1.5, 2.5};
  for (int i = 0; i < 4; ++i) {
    const Camera at = test::ring(4, middle, distances[i], heights[i])[i];
    keys[i].w2c = at.w2c;
  }
  const std::vector<Camera> path = camera_path(keys, 61);
  for (const Camera& c : path) {
    const Vector3d seen = c.w2c.topLeftCorner<3, 3>() * middle + c.w2c.topRightCorner<3, 1>();
    EXPECT_GT(seen.z(), 1.4);  // as near as the nearest key, as far as the farthest
    EXPECT_LT(seen.z(), 3.2);
    EXPECT_NEAR(c.fx * seen.x() / seen.z() + c.cx, 322, 1);
    EXPECT_NEAR(c.fy * seen.y() / seen.z() + c.cy, 237, 1);
    expect_rigid(c);
  }
  for (const Camera& key : keys) {
    double nearest = 1e9;
    for (const Camera& c : path) nearest = std::min(nearest, (c.w2c - key.w2c).norm());
    EXPECT_LT(nearest, 0.15);
  }
}

// Two cameras that face each other do not determine where between them the object is: the path uses the middle.
TEST(CameraPath, GoesRoundBetweenTwoThatFaceEachOther) {
  const std::vector<Camera> ring = test::ring(2, {0, 0, 0}, 2, 0);
  for (const Camera& c : camera_path(ring, 9)) EXPECT_NEAR(c.centre().norm(), 2, 1e-6);
}

// Cameras that look in the same direction, or away from each other, share no point: the path is straight.
TEST(CameraPath, GoesStraightWhereNothingIsLookedAt) {
  for (const double degrees : {0.0, 40.0}) {
    const std::vector<Camera> keys = {turned(-degrees, {0, 1, 0}, {-1, 0, 0}), turned(degrees, {0, 1, 0}, {1, 0, 0})};
    EXPECT_LT(camera_path(keys, 3)[1].centre().norm(), 1e-9) << degrees;
  }
}

TEST(CameraPath, RefusesWhatIsNoPath) {
  expect_error(Status::usage, {"key"}, [] { camera_path({}, 3); });
  for (const int count : {0, -1, max_path + 1})
    expect_error(Status::usage, {std::to_string(count)}, [&] { camera_path(test::ring(2), count); });
}

}  // namespace
}  // namespace vsplat

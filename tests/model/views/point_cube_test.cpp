#include "model/views/point_cube.h"

#include "model/base/rng.h"
#include "model/views/auto_frame.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

// A fixed sequence of numbers between -1 and 1.
class Random {
 public:
  double operator()() {
    return 2.0 * uniform01(philox4x32_10({count_++, 0, stream_of("test.points"), 0}, rng_key(1))[0]) - 1;
  }

 private:
  std::uint32_t count_ = 0;
};

ColoredPoint at(const Vector3d& position) { return {position, {128, 128, 128}, 0.3, 5}; }

// Points on the surface of a box.
std::vector<ColoredPoint> box(int count, const Vector3d& centre, const Vector3d& half) {
  Random random;
  std::vector<ColoredPoint> out;
  for (int i = 0; i < count; ++i) {
    Vector3d p(random(), random(), random());
    p[i % 3] = p[i % 3] < 0 ? -1 : 1;
    out.push_back(at(centre + p.cwiseProduct(half)));
  }
  return out;
}

void add(std::vector<ColoredPoint>& points, const std::vector<ColoredPoint>& more) {
  points.insert(points.end(), more.begin(), more.end());
}

int outside(const Placement& cube, const std::vector<ColoredPoint>& points) {
  int out = 0;
  for (const ColoredPoint& p : points) out += (p.position - cube.centre).cwiseAbs().maxCoeff() > 0.5 * cube.edge;
  return out;
}

TEST(PointCube, HoldsAnObjectThatTheCamerasDoNotLookAt) {
  const Vector3d centre(3.2, -2.1, 5.1), half(0.4, 0.2, 0.15);
  const std::vector<ColoredPoint> points = box(3000, centre, half);
  const auto found = cube_of_points(test::ring(12, {3, -2, 5}, 3), points);
  ASSERT_TRUE(found);
  EXPECT_LT((found->placement.centre - centre).norm(), 0.02);
  EXPECT_EQ(outside(found->placement, points), 0);
  EXPECT_LT(found->placement.edge, 2 * half.norm() * 1.06);  // in any rotation, and no larger
  EXPECT_GT(found->placement.edge, 2 * half.x());
}

TEST(PointCube, StrayAndFarPointsDoNotCount) {
  const Vector3d half(0.4, 0.3, 0.3);
  const std::vector<ColoredPoint> object = box(2000, {0, 0, 0}, half);
  const std::vector<Camera> cameras = test::ring(12, {0, 0, 0}, 3);
  const auto alone = cube_of_points(cameras, object);
  ASSERT_TRUE(alone);
  std::vector<ColoredPoint> points = object;
  Random random;
  for (int i = 0; i < 150; ++i) points.push_back(at(Vector3d(random(), random(), random())));       // sparse, around it
  for (int i = 0; i < 800; ++i) points.push_back(at(15 * Vector3d(random(), random(), random())));  // the surroundings
  add(points, box(700, {-40, 0, 0}, {0.1, 0.1, 0.1}));                          // a dense cluster that few cameras see
  std::vector<ColoredPoint> wrong = box(300, {0.9, 0, 0}, {0.02, 0.02, 0.02});  // dense and visible, but mismatched
  for (std::size_t i = 0; i < wrong.size(); ++i) (i % 2 ? wrong[i].error = 5 : wrong[i].track = 2);
  add(points, wrong);
  const auto found = cube_of_points(cameras, points);
  ASSERT_TRUE(found);
  EXPECT_EQ(outside(found->placement, object), 0);
  EXPECT_LT((found->placement.centre - alone->placement.centre).norm(), 0.15);
  EXPECT_LT(found->placement.edge, 1.4 * alone->placement.edge);
}

TEST(PointCube, FarFromTheOriginItIsAsGood) {
  const Vector3d far(1e7, -3e7, 2e7);
  std::vector<ColoredPoint> points = box(1000, {0, 0, 0}, {0.4, 0.3, 0.2});
  std::vector<Camera> cameras = test::ring(8, {0, 0, 0}, 3);
  const auto near = cube_of_points(cameras, points);
  for (ColoredPoint& p : points) p.position += far;
  for (Camera& c : cameras) c.w2c.topRightCorner<3, 1>() -= c.w2c.topLeftCorner<3, 3>() * far;
  const auto found = cube_of_points(cameras, points);
  ASSERT_TRUE(near && found);
  EXPECT_LT((found->placement.centre - far - near->placement.centre).norm(), 1e-6);
  EXPECT_NEAR(found->placement.edge, near->placement.edge, 1e-6);
}

TEST(PointCube, TooFewPointsAreNone) {
  const std::vector<Camera> cameras = test::ring(8);
  EXPECT_FALSE(cube_of_points(cameras, box(20, {0, 0, 0}, {0.3, 0.3, 0.3})));
  EXPECT_FALSE(cube_of_points(cameras, {}));
  EXPECT_FALSE(cube_of_points({}, box(2000, {0, 0, 0}, {0.3, 0.3, 0.3})));
  EXPECT_FALSE(cube_of_points(cameras, std::vector<ColoredPoint>(500, at({0, 0, 0})))) << "no extent";
}

TEST(PointCube, ACentreThatIsSettledStays) {
  const auto found =
      cube_of_points(test::ring(8, {0, 0, 0}, 3), box(2000, {0, 0, 0}, {0.3, 0.3, 0.3}), Vector3d(0.2, 0, 0));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->placement.centre, Vector3d(0.2, 0, 0));
  EXPECT_GT(found->placement.edge, 1);
}

TEST(AutoFrame, PointsComeBeforeMasksAndAxes) {
  const std::vector<Camera> cameras = test::ring(8, {0, 0, 0}, 4);
  const std::vector<ColoredPoint> object = box(2000, {0.3, 0.1, -0.2}, {0.3, 0.3, 0.3});
  const EstimatedPlacement found = auto_frame(cameras, {}, {}, object);
  EXPECT_LT((found.placement.centre - Vector3d(0.3, 0.1, -0.2)).norm(), 0.02);
  EXPECT_NE(found.from.find("of the 2000 points"), std::string::npos) << found.from;
  // The masks show only the object, so the table around it does not count.
  std::vector<ColoredPoint> points = object;
  add(points, box(3000, {0.3, 0.45, -0.2}, {1.2, 0.02, 1.2}));
  std::vector<std::optional<MaskExtent>> masks;
  for (const Camera& c : cameras) {
    MaskExtent& m = *masks.emplace_back(MaskExtent{1e9, 1e9, -1e9, -1e9});
    for (const ColoredPoint& p : object) {
      const Vector3d x = c.w2c.topLeftCorner<3, 3>() * (p.position - c.centre());
      const double u = c.fx * x.x() / x.z() + c.cx, v = c.fy * x.y() / x.z() + c.cy;
      m = {std::min(m.x0, u), std::min(m.y0, v), std::max(m.x1, u), std::max(m.y1, v)};
    }
  }
  const EstimatedPlacement masked = auto_frame(cameras, masks, {}, points), all = auto_frame(cameras, {}, {}, points);
  EXPECT_GT(all.placement.edge, 1.5 * masked.placement.edge);
  EXPECT_LT((masked.placement.centre - found.placement.centre).norm(), 0.1);
  EXPECT_LT(masked.placement.edge, 1.25 * found.placement.edge);
  EXPECT_NE(masked.from.find("that the masks hold"), std::string::npos) << masked.from;
  // Masks of about the points' size only confirm them.
  const EstimatedPlacement both = auto_frame(cameras, masks, {}, object);
  EXPECT_EQ(both.placement.edge, found.placement.edge);
  EXPECT_EQ(both.placement.centre, found.placement.centre);
}

}  // namespace
}  // namespace vsplat

#include "model/fit/whole_start.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr int kWholeSide = 48;

// Four cameras in a row that look along z at coloured pictures: blue above, green below.
class WholeStartTest : public ::testing::Test {
 protected:
  WholeStartTest() {
    for (int i = 0; i < 4; ++i) {
      ListedView view;
      view.camera.width = view.camera.height = kWholeSide;
      view.camera.fx = view.camera.fy = kWholeSide;
      view.camera.cx = view.camera.cy = kWholeSide / 2.0;
      view.camera.w2c(0, 3) = 1 - 0.5 * i;
      view.name = view.picture = std::to_string(i);
      photographs_.set.views.push_back(view);
      cameras_.push_back(view.camera);
      views_.push_back(i);
    }
    photographs_.picture = [](int) {
      Image out(kWholeSide, kWholeSide, 3);
      for (std::size_t i = 0; i < kWholeSide * kWholeSide; ++i)
        out.data[3 * i + (i < kWholeSide * kWholeSide / 2 ? 2 : 1)] = 1;
      return out;
    };
  }

  // Points in the right half of all pictures.
  std::vector<ColoredPoint> points(int count) const {
    constexpr int kColumns = 25;
    std::vector<ColoredPoint> out(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
      const int column = i % kColumns, row = i / kColumns;
      out[static_cast<std::size_t>(i)] = {
          Vector3d(1 + 1.2 * column / kColumns, 2.4 * kColumns * row / count - 1.2, 6), {255, 0, 0}, 0.5, 4};
    }
    return out;
  }
  Scene make(std::vector<ColoredPoint> points, long most = 0, std::uint64_t seed = 3) {
    WholeStart start{scene_frame(cameras_, points), std::move(points), most, 3000, seed};
    unit_ = start.frame.placement.edge;
    return whole_scene(start, photographs_, views_);
  }
  static Vector3d mean_of(const Scene& scene, std::size_t k) {
    return Eigen::Map<const Eigen::Vector3f>(&scene.gaussians.means[3 * k]).cast<double>();
  }

  Photographs photographs_;
  std::vector<Camera> cameras_;
  std::vector<int> views_;
  double unit_ = 0;
};

TEST_F(WholeStartTest, PointsComeFirstAndFarOnesWhereThereAreNone) {
  const std::vector<ColoredPoint> all = points(1000);
  const Scene scene = make(all);
  const Gaussians& g = scene.gaussians;
  ASSERT_GT(g.count, 1000U);
  EXPECT_LE(g.count, 1050U);
  EXPECT_NEAR(scene.near, 0.06, 1e-4);
  for (std::size_t k = 0; k < 1000; ++k) {
    EXPECT_NEAR((mean_of(scene, k) - all[k].position).norm(), 0, 1e-5);
    EXPECT_NEAR(0.5 + kShC0 * g.sh[3 * k], 1, 1e-5);
  }
  for (std::size_t k = 1000; k < g.count; ++k) {
    EXPECT_GE(mean_of(scene, k).norm(), 9 * unit_);
    EXPECT_LE(mean_of(scene, k).norm(), 101 * unit_);
    bool seen = false, alone = false;
    for (const Camera& camera : cameras_)
      if (const auto at = seen_at(camera, mean_of(scene, k))) {
        seen = true;
        const auto in_its_cell = [&](const ColoredPoint& point) {
          const auto there = seen_at(camera, point.position);
          return there && std::floor(there->x() / 2) == std::floor(at->x() / 2) &&
                 std::floor(there->y() / 2) == std::floor(at->y() / 2);
        };
        alone = alone || std::none_of(all.begin(), all.end(), in_its_cell);
        EXPECT_NEAR(0.5 + kShC0 * g.sh[3 * k + 2], at->y() < kWholeSide / 2.0 - 1,
                    at->y() > kWholeSide / 2.0 + 1 ? 0.01 : 1.01);
      }
    EXPECT_TRUE(seen);
    EXPECT_TRUE(alone);
  }
}

TEST_F(WholeStartTest, TheirNumberIsLimited) {
  EXPECT_EQ(make(points(1000), 100).gaussians.count, 100U);
  EXPECT_EQ(make({}, 100).gaussians.count, 100U);
  EXPECT_EQ(make(points(1)).gaussians.count, 1U);
}

TEST_F(WholeStartTest, WithoutPointsTheyAreWhereThePicturesLook) {
  EXPECT_EQ(make({}).gaussians.count, 3150U);
  const Scene scene = make({}, 2000);
  ASSERT_EQ(scene.gaussians.count, 2000U);
  for (const float opacity : scene.gaussians.opacities) EXPECT_FLOAT_EQ(opacity, 0.1f);
  std::size_t above = 0;
  for (std::size_t k = 0; k < 2000; ++k) {
    bool seen = false;
    for (const Camera& camera : cameras_) seen = seen || seen_at(camera, mean_of(scene, k));
    EXPECT_TRUE(seen) << k;
    const bool is_blue = scene.gaussians.sh[3 * k + 2] > 0;
    above += is_blue;
    EXPECT_EQ(is_blue, mean_of(scene, k).y() < 0) << k;
  }
  EXPECT_NEAR(static_cast<double>(above), 1000, 100);
}

TEST_F(WholeStartTest, EqualSeedsGiveEqualScenes) {
  const std::vector<float> means = make({}, 300).gaussians.means;
  EXPECT_EQ(make({}, 300).gaussians.means, means);
  EXPECT_NE(make({}, 300, 4).gaussians.means, means);
}

TEST_F(WholeStartTest, AMillionUnitsWideItIsAsExact) {
  for (ListedView& view : photographs_.set.views) view.camera.w2c.topRightCorner<3, 1>() *= 1e6;
  for (Camera& camera : cameras_) camera.w2c.topRightCorner<3, 1>() *= 1e6;
  std::vector<ColoredPoint> all = points(1000);
  for (ColoredPoint& point : all) point.position *= 1e6;
  const Scene large = make(all);
  const double unit = unit_;
  EXPECT_NEAR(unit, 1e6 * 1.1 * 0.75, 1);
  EXPECT_NEAR(large.near, 6e4, 10);
  EXPECT_NEAR((mean_of(large, 7) - all[7].position).norm(), 0, 1);
}

}  // namespace
}  // namespace vsplat

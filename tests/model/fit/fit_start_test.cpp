#include "model/fit/fit_start.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/views/seen_points.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

Placement cube() { return {Eigen::Vector3d(10, -20, 5), 4}; }

ColoredPoint point(double x, double y, double z, std::array<std::uint8_t, 3> rgb = {255, 0, 51}) {
  return {Eigen::Vector3d(10, -20, 5) + 4 * Eigen::Vector3d(x, y, z), rgb, 0.5, 3};
}

// Distances by comparing all pairs.
double mean_of_nearest(const std::vector<ColoredPoint>& points, std::size_t i) {
  std::vector<double> all;
  for (std::size_t j = 0; j < points.size(); ++j)
    if (j != i) all.push_back((points[i].position - points[j].position).norm());
  std::sort(all.begin(), all.end());
  return (all[0] + all[1] + all[2]) / 3;
}

TEST(FitStart, PointsBecomeRoundGaussiansAsLargeAsTheirNeighboursAreFar) {
  std::vector<ColoredPoint> points;
  points.reserve(60);
  for (int i = 0; i < 60; ++i)
    points.push_back(point(0.4 * std::sin(i), 0.4 * std::cos(3.0 * i), 0.4 * std::sin(7.0 * i)));
  const Scene scene = scene_from_points(points, cube());
  const Gaussians& g = scene.gaussians;
  ASSERT_EQ(g.count, 60U);
  EXPECT_EQ(g.sh_degree, 0);
  EXPECT_FLOAT_EQ(scene.near, 0.8f);
  for (std::size_t i = 0; i < 60; ++i) {
    EXPECT_NEAR(g.means[3 * i + 1], points[i].position.y(), 1e-5);
    EXPECT_EQ(g.opacities[i], 0.5f);
    EXPECT_NEAR(g.scales[3 * i], std::min(mean_of_nearest(points, i), 0.4), 1e-5) << i;
    EXPECT_EQ(g.scales[3 * i], g.scales[3 * i + 2]);
    EXPECT_EQ(g.quats[4 * i], 1.0f);
    EXPECT_NEAR(0.5 + kShC0 * g.sh[3 * i], 1, 1e-6);
    EXPECT_NEAR(0.5 + kShC0 * g.sh[3 * i + 2], 0.2, 1e-6);
  }
}

TEST(FitStart, PointsBesideTheCubeAreLeftOut) {
  const std::vector<ColoredPoint> points{point(0.6, 0, 0), point(0.1, 0, 0), point(0, -0.51, 0), point(0, 0.2, 0)};
  const Scene scene = scene_from_points(points, cube());
  ASSERT_EQ(scene.gaussians.count, 2U);
  EXPECT_NEAR(scene.gaussians.means[0], 10.4, 1e-5);
  EXPECT_THROW(scene_from_points(std::span(points).first(1), cube()), Error);
  EXPECT_EQ(scene_from_points(points, cube(), 1).gaussians.count, 1U);
}

TEST(FitStart, PointsOnOneSpotAreNotInfinitelySmall) {
  const std::vector<ColoredPoint> points(5, point(0, 0, 0));
  for (const float scale : scene_from_points(points, cube()).gaussians.scales) EXPECT_FLOAT_EQ(scale, 4e-4f);
  EXPECT_FLOAT_EQ(scene_from_points(std::span(points).first(1), cube()).gaussians.scales[0], 0.4f);
}

TEST(FitStart, FarFromTheOriginItIsAboutTheCube) {
  const Eigen::Vector3d far(1e8, -2e8, 5e7);
  Placement there = cube();
  there.centre += far;
  std::vector<ColoredPoint> here, moved;
  for (int i = 0; i < 20; ++i) {
    here.push_back(point(0.4 * std::sin(i), 0.4 * std::cos(3.0 * i), 0.4 * std::sin(7.0 * i)));
    moved.push_back(here.back());
    moved.back().position += far;
  }
  const Scene near = scene_from_points(here, cube()), distant = scene_from_points(moved, there);
  EXPECT_EQ(near.offset, Eigen::Vector3d::Zero());
  EXPECT_EQ(distant.offset, there.centre);
  for (std::size_t i = 0; i < near.gaussians.means.size(); ++i)
    EXPECT_NEAR(distant.gaussians.means[i] + cube().centre[static_cast<Eigen::Index>(i % 3)], near.gaussians.means[i],
                2e-6);
}

// Grey pictures of the cube from `count` sides; a centred disc of `radius` pixels is the object, and red. 0: no mask.
struct Pictures {
  Pictures(int count, double radius) {
    for (int i = 0; i < count; ++i) {
      ListedView view;
      view.camera = look_at_cube(i * 6.2831853 / count);
      view.name = std::to_string(i);
      view.picture = view.name;
      photographs.set.views.push_back(view);
      views.push_back(i);
    }
    photographs.picture = [radius](int) {
      Image out(kSide, kSide, radius > 0 ? 4 : 3);
      for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
          float* pixel = &out.data[static_cast<std::size_t>(y * kSide + x) * static_cast<std::size_t>(out.channels)];
          const bool inside = std::hypot(x + 0.5 - kSide / 2.0, y + 0.5 - kSide / 2.0) < radius;
          pixel[0] = inside ? 1.0f : 0.5f, pixel[1] = pixel[2] = inside ? 0.0f : 0.5f;
          if (radius > 0) pixel[3] = inside ? 1.0f : 0.0f;
        }
      return out;
    };
  }
  Pictures(const Pictures&) = delete;

  // 12 units from the cube's centre, in its horizontal plane; 64 pixels show 6 units there.
  static Camera look_at_cube(double angle) {
    Camera out;
    out.width = out.height = kSide;
    out.fx = out.fy = 2.0 * kSide;
    out.cx = out.cy = kSide / 2.0;
    const Eigen::Vector3d forward(std::cos(angle), std::sin(angle), 0), down(0, 0, -1), right = down.cross(forward);
    Eigen::Matrix3d R;
    R << right.transpose(), down.transpose(), forward.transpose();
    out.w2c.topLeftCorner<3, 3>() = R;
    out.w2c.topRightCorner<3, 1>() = -R * (cube().centre - 12 * forward);
    return out;
  }

  static constexpr int kSide = 64;
  Photographs photographs;
  std::vector<int> views;
};

TEST(FitStart, ARandomStartFillsTheCubeAndFollowsItsSeed) {
  const Pictures p(4, 0);
  const Gaussians a = random_scene(cube(), 1000, 7, p.photographs, p.views).gaussians;
  EXPECT_EQ(a.means, random_scene(cube(), 1000, 7, p.photographs, p.views).gaussians.means);
  EXPECT_NE(a.means, random_scene(cube(), 1000, 8, p.photographs, p.views).gaussians.means);
  double low = 1e9, high = -1e9, sum = 0;
  for (std::size_t i = 0; i < 1000; ++i) {
    low = std::min<double>(low, a.means[3 * i]), high = std::max<double>(high, a.means[3 * i]);
    sum += a.means[3 * i];
  }
  EXPECT_GE(low, 8);
  EXPECT_LE(high, 12);
  EXPECT_LT(low, 8.1);
  EXPECT_GT(high, 11.9);
  EXPECT_NEAR(sum / 1000, 10, 0.15);
  EXPECT_NEAR(a.sh[0], 0.0f, 0.01f);
}

TEST(FitStart, ARandomStartLiesWhereAllMasksShowTheObject) {
  const Pictures p(6, 10);
  for (const double edge : {4.0, 40.0}) {
    const Gaussians g = random_scene({cube().centre, edge}, 500, 7, p.photographs, p.views).gaussians;
    ASSERT_EQ(g.count, 500U) << edge;
    for (std::size_t i = 0; i < g.count; ++i) {
      for (const int view : p.views) {
        const auto at = seen_at(Pictures::look_at_cube(view * 6.2831853 / 6),
                                Eigen::Map<const Eigen::Vector3f>(&g.means[3 * i]).cast<double>());
        ASSERT_TRUE(at);
        EXPECT_LT(std::hypot(at->x() - 32, at->y() - 32), 10.8);
      }
      EXPECT_NEAR(0.5 + kShC0 * g.sh[3 * i], 1, 0.01);
      EXPECT_NEAR(0.5 + kShC0 * g.sh[3 * i + 1], 0, 0.01);
    }
  }
}

TEST(FitStart, WithoutAPlaceThatAllMasksShowItIsAnywhere) {
  Pictures p(6, 10);
  for (ListedView& view : p.photographs.set.views) view.camera.w2c(2, 3) -= 1e6;
  EXPECT_EQ(random_scene(cube(), 50, 7, p.photographs, p.views).gaussians.count, 50U);
}

}  // namespace
}  // namespace vsplat

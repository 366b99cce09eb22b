#include "model/fit/fit_start.h"

#include <gtest/gtest.h>

#include <cmath>

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
  for (int i = 0; i < 60; ++i)
    points.push_back(point(0.4 * std::sin(i), 0.4 * std::cos(3.0 * i), 0.4 * std::sin(7.0 * i)));
  const Scene scene = scene_from_points(points, cube());
  const Gaussians& g = scene.gaussians;
  ASSERT_EQ(g.count, 60U);
  EXPECT_EQ(g.sh_degree, 0);
  EXPECT_FLOAT_EQ(scene.near, 0.8f);
  for (std::size_t i = 0; i < 60; ++i) {
    EXPECT_NEAR(g.means[3 * i + 1], points[i].position.y(), 1e-5);
    EXPECT_EQ(g.opacities[i], 0.1f);
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
  EXPECT_EQ(random_scene(there, 5, 1).offset, there.centre);
}

TEST(FitStart, ARandomStartFillsTheCubeAndFollowsItsSeed) {
  const Gaussians a = random_scene(cube(), 1000, 7).gaussians, b = random_scene(cube(), 1000, 7).gaussians;
  EXPECT_EQ(a.means, b.means);
  EXPECT_NE(a.means, random_scene(cube(), 1000, 8).gaussians.means);
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
  EXPECT_EQ(a.sh[0], 0.0f);
}

}  // namespace
}  // namespace vsplat

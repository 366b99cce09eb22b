#include "model/base/scene_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "model/base/scene_statistics.h"

namespace vsplat {
namespace {

struct Spot {
  std::array<float, 3> at{};
  float size = 0.01f, opacity = 0.5f;
};

Scene scene_of(const std::vector<Spot>& spots) {
  Scene out;
  Gaussians& g = out.gaussians;
  for (const Spot& s : spots) {
    g.means.insert(g.means.end(), s.at.begin(), s.at.end());
    g.scales.insert(g.scales.end(), {s.size, 0.5f * s.size, 0.25f * s.size});
    g.quats.insert(g.quats.end(), {1, 0, 0, 0});
    g.opacities.push_back(s.opacity);
    g.sh.insert(g.sh.end(), {0, 0, 0});
    ++g.count;
  }
  return out;
}

std::vector<float> xs(const Scene& scene) {
  std::vector<float> out;
  for (std::size_t k = 0; k < scene.gaussians.count; ++k) out.push_back(scene.gaussians.means[3 * k]);
  return out;
}

TEST(SceneFilter, CountsWithTheFirstRuleThatRemoves) {
  Scene scene = scene_of({{{0, 0, 0}},
                          {{1, 0, 0}},                 // on the box's face: inside
                          {{2, 0, 0}, 0.01f, 0.001f},  // outside the box, and transparent
                          {{0.5f, 0.9f, 0}},           // outside the sphere
                          {{0.1f, 0, 0}, 0.01f, 0.09f},
                          {{0.2f, 0, 0}, 0.5f}});
  SceneFilter what;
  what.box = Box{{-1, -1, -1}, {1, 1, 1}};
  what.sphere = Sphere{{0, 0, 0}, 1};
  what.min_opacity = 0.1;
  what.max_size = 0.3;
  const FilteredGaussians removed = filter(scene, what);
  EXPECT_EQ(xs(scene), (std::vector<float>{0, 1}));
  EXPECT_EQ(removed.box, 1u);
  EXPECT_EQ(removed.sphere, 1u);
  EXPECT_EQ(removed.opacity, 1u);
  EXPECT_EQ(removed.size, 1u);
  EXPECT_EQ(removed.floaters, 0u);
}

TEST(SceneFilter, PlacesAreInTheWorld) {
  Scene scene = scene_of({{{0, 0, 0}}, {{1, 0, 0}}});
  scene.offset = {1000, 0, 0};
  SceneFilter what;
  what.box = Box{{1000.5, -1, -1}, {1002, 1, 1}};
  filter(scene, what);
  EXPECT_EQ(xs(scene), std::vector<float>{1});
  what = {};
  what.sphere = Sphere{{1, 0, 0}, 10};
  EXPECT_EQ(filter(scene, what).sphere, 1u);
}

TEST(SceneFilter, NothingAskedForKeepsEverything) {
  Scene scene = scene_of({{{0, 0, 0}, 5.0f, 0.0f}, {{1e6f, 0, 0}}});
  filter(scene, {});
  EXPECT_EQ(scene.gaussians.count, 2u);
}

// A dense ball, three Gaussians alone in space, and a sparse background of Gaussians as large as their distances.
TEST(SceneFilter, FloatersAreAloneAndSmall) {
  std::mt19937 engine(4);
  std::normal_distribution<float> normal;
  std::vector<Spot> spots;
  spots.reserve(2000 + 3 + 60);
  for (int i = 0; i < 2000; ++i)
    spots.push_back({{0.1f * normal(engine), 0.1f * normal(engine), 0.1f * normal(engine)}});
  for (Spot& s : spots)  // no strays among them
    for (float& v : s.at) v = std::clamp(v, -0.2f, 0.2f);
  const std::size_t dense = spots.size();
  for (const float x : {2.0f, -3.0f, 5.0f}) spots.push_back({{x, 0.3f * x, 0}, 0.02f});
  for (int i = 0; i < 60; ++i) {
    const std::array<float, 3> d{normal(engine), normal(engine), normal(engine)};
    const float to = 20 / std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    spots.push_back({{to * d[0], to * d[1], to * d[2]}, 8.0f});
  }
  Scene scene = scene_of(spots);
  const std::vector<bool> found = floaters(scene.gaussians);
  for (std::size_t k = 0; k < found.size(); ++k)
    EXPECT_EQ(found[k], k >= dense && k < dense + 3) << "Gaussian " << k << " at " << spots[k].at[0];
  SceneFilter what;
  what.without_floaters = true;
  EXPECT_EQ(filter(scene, what).floaters, 3u);
  EXPECT_EQ(scene.gaussians.count, spots.size() - 3);
}

TEST(SceneFilter, FewOrEqualPlacesHaveNoFloaters) {
  EXPECT_EQ(floaters(scene_of({{{0, 0, 0}}, {{100, 0, 0}}}).gaussians), std::vector<bool>(2, false));
  std::vector<Spot> equal(30);
  equal.push_back({{9, 0, 0}});
  EXPECT_EQ(floaters(scene_of(equal).gaussians), std::vector<bool>(31, false));
}

TEST(SceneStatistics, CountsByHand) {
  std::vector<Spot> spots;
  for (int i = 0; i <= 100; ++i) spots.push_back({{static_cast<float>(i), 0, 0}, 1.0f, 0.5f});
  spots[0].opacity = 0.001f;  // invisible, and so transparent
  spots[1].opacity = 0.05f;
  spots[2].size = 30;       // more than a tenth of 98
  spots[100].at[0] = 5000;  // the median distance from x = 50 is 25
  Scene scene = scene_of(spots);
  scene.offset = {0, 7, 0};
  const SceneStatistics s = statistics_of(scene);
  EXPECT_EQ(s.not_finite, 0u);
  EXPECT_EQ(s.transparent, 2u);
  EXPECT_EQ(s.invisible, 1u);
  EXPECT_EQ(s.huge, 1u);
  EXPECT_EQ(s.distant, 1u);
  EXPECT_EQ(s.low, Eigen::Vector3d(0, 7, 0));
  EXPECT_EQ(s.high, Eigen::Vector3d(5000, 7, 0));
  EXPECT_EQ(s.low_1, Eigen::Vector3d(1, 7, 0));
  EXPECT_EQ(s.high_99, Eigen::Vector3d(99, 7, 0));
  EXPECT_EQ(s.median_opacity, 0.5);
  EXPECT_EQ(s.median_size, 1);
  EXPECT_EQ(s.largest_size, 30);
}

TEST(SceneStatistics, NotFiniteCountsInNothingElse) {
  Scene scene = scene_of({{{1, 2, 3}, 1.0f, 0.0f}, {{4, 5, 6}, 2.0f, 0.6f}});
  scene.gaussians.sh[2] = std::numeric_limits<float>::quiet_NaN();
  const SceneStatistics s = statistics_of(scene);
  EXPECT_EQ(s.not_finite, 1u);
  EXPECT_EQ(s.invisible, 0u);
  EXPECT_EQ(s.low, Eigen::Vector3d(4, 5, 6));
  const SceneStatistics none = statistics_of(Scene());
  EXPECT_EQ(none.high, Eigen::Vector3d::Zero());
  EXPECT_EQ(none.largest_size, 0);
}

}  // namespace
}  // namespace vsplat

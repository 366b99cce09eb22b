#include "model/base/scene_difference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <random>
#include <vector>

#include "runtime/error.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

Scene scene_of(std::size_t count) {
  Scene out;
  out.gaussians = test::make_scene({"", count, 1, 0, 0, ""}, 5);
  return out;
}

Gaussians shuffled(const Gaussians& g) {
  std::vector<std::size_t> order(g.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(8));
  Gaussians out = g;
  const auto copy = [&](const std::vector<float>& from, std::vector<float>& to, std::size_t each) {
    for (std::size_t k = 0; k < g.count; ++k) std::copy_n(&from[each * order[k]], each, &to[each * k]);
  };
  copy(g.means, out.means, 3);
  copy(g.scales, out.scales, 3);
  copy(g.quats, out.quats, 4);
  copy(g.opacities, out.opacities, 1);
  copy(g.sh, out.sh, 3 * g.sh_count());
  return out;
}

TEST(SceneDifference, EqualScenesHaveNone) {
  const Scene scene = scene_of(50);
  const SceneDifference d = difference(scene, scene);
  EXPECT_TRUE(d.in_order);
  for (const Differences& each : {d.means, d.scales, d.rotations, d.opacities, d.sh}) {
    EXPECT_EQ(each.largest, 0);
    EXPECT_EQ(each.rms, 0);
  }
}

// Without a spread, distances do not show the order.
TEST(SceneDifference, OfOneGaussianAndOfCoincidentOnes) {
  Scene one = scene_of(1), moved = one;
  moved.gaussians.means[0] += 0.25f;
  EXPECT_TRUE(difference(one, moved).in_order);
  EXPECT_NEAR(difference(one, moved).means.largest, 0.25, 1e-6);
  Scene all = scene_of(4);
  for (std::size_t i = 0; i < all.gaussians.means.size(); ++i) all.gaussians.means[i] = 1;
  moved = all;
  moved.gaussians.means[3 * 2] += 0.25f;
  const SceneDifference d = difference(all, moved);
  EXPECT_NEAR(d.means.largest, 0.25, 1e-6);
  EXPECT_EQ(d.sh.largest, 0) << "each is compared with itself, the one most like it";
}

// One value of each kind is changed by a known amount, with the Gaussians in order and in another.
TEST(SceneDifference, FindsWhatWasChanged) {
  const Scene scene = scene_of(400);
  for (const bool moved : {false, true}) {
    Scene other = scene;
    Gaussians& g = other.gaussians;
    g.means[3 * 7 + 1] += 0.001f;
    g.scales[3 * 20] += 0.002f;
    g.opacities[30] += g.opacities[30] > 0.5f ? -0.25f : 0.25f;
    g.sh[3 * g.sh_count() * 40 + 5] += 0.125f;
    // A turn by 2 degrees about the Gaussian's own x axis.
    float* q = &g.quats[4 * 50];
    const double c = std::cos(M_PI / 180), s = std::sin(M_PI / 180);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    q[0] = static_cast<float>(-(w * c - x * s));  // and the other sign, which is the same rotation
    q[1] = static_cast<float>(-(w * s + x * c));
    q[2] = static_cast<float>(-(y * c + z * s));
    q[3] = static_cast<float>(-(z * c - y * s));
    if (moved) g = shuffled(g);
    const SceneDifference d = difference(scene, other);
    EXPECT_EQ(d.in_order, !moved);
    EXPECT_NEAR(d.means.largest, 0.001, 1e-6);
    EXPECT_NEAR(d.means.rms, 0.001 / 20, 1e-7);
    EXPECT_NEAR(d.scales.largest, 0.002, 1e-6);
    EXPECT_NEAR(d.scales.rms, 0.002 / std::sqrt(1200), 1e-7);
    EXPECT_NEAR(d.rotations.largest, 2, 1e-3);
    EXPECT_NEAR(d.opacities.largest, 0.25, 1e-6);
    EXPECT_NEAR(d.opacities.rms, 0.25 / 20, 1e-6);
    EXPECT_NEAR(d.sh.largest, 0.125, 1e-6);
  }
}

TEST(SceneDifference, PlacesAreInTheWorldAndMissingDegreesAreZero) {
  const Scene scene = scene_of(10);
  Scene other = scene;
  other.offset = {0, 0.001, 0};
  EXPECT_NEAR(difference(scene, other).means.rms, 0.001, 1e-9);
  other = scene;
  other.gaussians.sh_degree = 0;
  std::vector<float> constant;
  double largest = 0;
  for (std::size_t i = 0; i < scene.gaussians.sh.size(); ++i) {
    if (i % 12 < 3)
      constant.push_back(scene.gaussians.sh[i]);
    else
      largest = std::max(largest, std::abs(static_cast<double>(scene.gaussians.sh[i])));
  }
  other.gaussians.sh = constant;
  EXPECT_EQ(difference(scene, other).sh.largest, largest);
  EXPECT_GT(largest, 0);
}

TEST(SceneDifference, RefusesOtherGaussians) {
  EXPECT_THROW(difference(scene_of(3), scene_of(4)), Error);
  Scene flat;
  flat.gaussians = test::make_surfels({"", 3, 1, 0, 0, ""}, 5);
  EXPECT_THROW(difference(scene_of(3), flat), Error);
}

}  // namespace
}  // namespace vsplat

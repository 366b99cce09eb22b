#include "model/base/merged_gaussians.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "model/base/scene.h"
#include "model/render/render.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

void add_upright(Gaussians& g, const Eigen::Vector3f& mean, const Eigen::Vector3f& scales, float opacity, float red) {
  for (int i = 0; i < 3; ++i) g.means.push_back(mean[i]), g.scales.push_back(scales[i]);
  for (const float q : {1.0f, 0.0f, 0.0f, 0.0f}) g.quats.push_back(q);
  for (const float c : {red, 0.0f, 0.0f}) g.sh.push_back(c);
  g.opacities.push_back(opacity);
  ++g.count;
}

// Sorted, since the order of axes is free.
Eigen::Vector3f sorted_scales(const Gaussians& g, std::size_t k) {
  Eigen::Vector3f out(g.scales[3 * k], g.scales[3 * k + 1], g.scales[3 * k + 2]);
  std::sort(out.data(), out.data() + 3);
  return out;
}

TEST(MergedGaussians, FewEnoughStayAsTheyAre) {
  Gaussians g;
  for (int i = 0; i < 3; ++i) add_upright(g, {0.1f * static_cast<float>(i), 0, 0}, {0.1f, 0.2f, 0.3f}, 0.5f, 1);
  EXPECT_EQ(merged_gaussians(g, 3).means, g.means);
  EXPECT_EQ(merged_gaussians(g, 100).scales, g.scales);
  EXPECT_EQ(merged_gaussians({}, 0).count, 0U);
}

TEST(MergedGaussians, APairBecomesItsMomentsByWhatItAbsorbs) {
  Gaussians g;
  const double faintest = 1.0 / 255;  // what is not drawn absorbs nothing
  add_upright(g, {0, 0, 0}, {0.1f, 0.1f, 0.01f}, static_cast<float>(1 - std::exp(-0.2 - faintest)), 1);
  add_upright(g, {0.3f, 0, 0}, {0.1f, 0.1f, 0.01f}, static_cast<float>(1 - std::exp(-0.4 - faintest)), 4);
  const Gaussians out = merged_gaussians(g, 1);
  ASSERT_EQ(out.count, 1U);
  EXPECT_NEAR(out.means[0], 0.2, 1e-6);
  EXPECT_NEAR(out.sh[0], 3, 1e-6);
  const double along = std::sqrt(0.1 * 0.1 + (0.2 * 0.2 + 2 * 0.1 * 0.1) / 3);
  const Eigen::Vector3f scales = sorted_scales(out, 0);
  EXPECT_NEAR(scales[0], 0.01, 1e-6);
  EXPECT_NEAR(scales[1], 0.1, 1e-6);
  EXPECT_NEAR(scales[2], along, 1e-6);
  EXPECT_NEAR(out.opacities[0], 1 - std::exp(-faintest - (0.2 + 0.4) * 0.01 / (0.1 * along)), 1e-6);
}

TEST(MergedGaussians, OneAloneKeepsItsShape) {
  Gaussians g;
  add_upright(g, {0, 0, 0}, {0.02f, 0.05f, 0.01f}, 0.3f, 2);
  add_upright(g, {5, 0, 0}, {0.02f, 0.02f, 0.02f}, 0.9f, 1);
  add_upright(g, {5.01f, 0, 0}, {0.02f, 0.02f, 0.02f}, 0.9f, 1);
  const Gaussians out = merged_gaussians(g, 2);
  ASSERT_EQ(out.count, 2U);
  const std::size_t alone = out.means[0] < 1 ? 0 : 1;
  const Eigen::Vector3f scales = sorted_scales(out, alone);
  EXPECT_NEAR(scales[0], 0.01, 1e-6);
  EXPECT_NEAR(scales[1], 0.02, 1e-6);
  EXPECT_NEAR(scales[2], 0.05, 1e-6);
  EXPECT_NEAR(out.opacities[alone], 0.3, 1e-6);
  EXPECT_NEAR(out.opacities[1 - alone], 0.95, 1e-6);  // two opaque ones on one spot
}

TEST(MergedGaussians, TheDarkestGoIfThereAreTooManyCells) {
  Gaussians g;
  for (int i = 0; i < 13; ++i) add_upright(g, {static_cast<float>(i), 0, 0}, {0.1f, 0.1f, 0.1f}, 0.9f, 1);
  g.opacities[4] = 0.01f;
  g.opacities[7] = 0.02f;
  g.opacities[12] = 0.03f;
  const Gaussians out = merged_gaussians(g, 10);
  ASSERT_EQ(out.count, 10U);
  for (const float opacity : out.opacities) EXPECT_GT(opacity, 0.5f);
}

TEST(MergedGaussians, CellsHaveTheGivenEdge) {
  Gaussians g;
  for (int i = 0; i < 12; ++i) add_upright(g, {0.25f * static_cast<float>(i), 0, 0}, {0.1f, 0.1f, 0.1f}, 0.1f, 1);
  for (const std::size_t in_one : {1, 2, 3, 4, 6, 12}) {
    const Gaussians out = merged_in_cells(g, 0.25 * static_cast<double>(in_one) - 1e-3);
    EXPECT_EQ(out.count, 12 / in_one) << in_one;
  }
  g.opacities.assign(12, 0.9f / 255);  // none is drawn
  EXPECT_EQ(merged_in_cells(g, 1).count, 0U);
  EXPECT_EQ(merged_in_cells({}, 1).count, 0U);
}

// A transparent, dense sphere.
Gaussians dense_ball(std::size_t count) {
  Gaussians g;
  const auto random = test::random_floats(3 * count, 5, -1, 1);
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector3f way = Eigen::Vector3f(random[3 * k], random[3 * k + 1], random[3 * k + 2]).normalized();
    const double red = 0.4 * std::sin(4 * way.x()) / kShC0;
    add_upright(g, 0.35f * way, Eigen::Vector3f::Constant(0.02f), 0.08f, static_cast<float>(red));
  }
  return g;
}

// How alike two scenes look from three sides: the least PSNR.
double alike(const Gaussians& a, const Gaussians& b) {
  Context& ctx = test::context(Flavour::cpu);
  double out = 1000;
  for (const Camera& camera : test::orbit(3, 96)) {
    const auto before = render_picture(ctx, upload(ctx, a), camera, {}).colour.data;
    const auto after = render_picture(ctx, upload(ctx, b), camera, {}).colour.data;
    double squared = 0;
    for (std::size_t i = 0; i < before.size(); ++i) squared += std::pow(static_cast<double>(before[i] - after[i]), 2);
    out = std::min(out, -10 * std::log10(squared / static_cast<double>(before.size()) + 1e-12));
  }
  return out;
}

TEST(MergedGaussians, ADenseBallLooksTheSameWithATenth) {
  const std::size_t count = 20000;
  const Gaussians g = dense_ball(count), fewer = merged_gaussians(g, count / 10);
  EXPECT_LE(fewer.count, count / 10);
  EXPECT_GT(fewer.count, count / 20);
  EXPECT_GT(alike(g, fewer), 25);
}

// Gaussians that are hardly drawn, of which most of each is left out, must not show more together.
TEST(MergedGaussians, AFaintBallLooksTheSameWithATenth) {
  const std::size_t count = 20000;
  Gaussians g = dense_ball(count);
  g.opacities.assign(count, 0.012f);
  EXPECT_GT(alike(g, merged_gaussians(g, count / 10)), 30);
}

TEST(MeanOfScenes, OfEqualOnesLooksTheSame) {
  const Gaussians g = dense_ball(4000);
  EXPECT_EQ(mean_of({g}).opacities, g.opacities);
  const Gaussians all = mean_of({g, g, g, g});
  ASSERT_EQ(all.count, 4 * g.count);
  EXPECT_EQ(all.means[3 * g.count + 5], g.means[5]);
  EXPECT_GT(alike(g, all), 35);
}

TEST(MeanOfScenes, AbsorbsHalfOfWhatOneOfTwoShows) {
  Gaussians g, none;
  add_upright(g, {0, 0, 0}, {0.3f, 0.3f, 0.3f}, 0.75f, 1);
  const Gaussians out = mean_of({none, g});
  ASSERT_EQ(out.count, 1U);
  EXPECT_NEAR(out.opacities[0], 1 - std::sqrt(0.25) * std::exp(-0.5 / 255), 1e-6);
}

}  // namespace
}  // namespace vsplat

#include "model/fit/screen_size.h"

#include <algorithm>
#include <cmath>

#include "model/fit/fitter.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

constexpr int kSide = 256;

Camera at_origin() {
  Camera c;
  c.width = c.height = kSide;
  c.fx = c.fy = 300;
  c.cx = c.cy = kSide / 2.0;
  c.w2c = Eigen::Matrix4d::Identity();
  return c;
}

// Half of the Gaussians are small and distant, the others large and near.
struct Crowd {
  ScreenGaussians gaussians;
  std::vector<float> log_scales;
};
Crowd crowd(int count) {
  Crowd out;
  for (int k = 0; k < count; ++k) {
    const bool near = k % 2 == 1;
    const float z = near ? 0.4f : 2.0f, x = 0.3f * z * std::sin(1.7f * static_cast<float>(k));
    for (const float v : {x, 0.2f * z * std::cos(0.9f * static_cast<float>(k)), z}) out.gaussians.means.push_back(v);
    out.gaussians.logits.push_back(1);
    for (int i = 0; i < 3; ++i) out.log_scales.push_back(std::log(near ? 0.2f + 0.1f * static_cast<float>(i) : 0.01f));
  }
  return out;
}

// Number of deviations of the largest scale that fit into a picture.
double widths(const Crowd& c, int k) {
  const float* s = &c.log_scales[static_cast<std::size_t>(3 * k)];
  return 300 * std::exp(std::max({s[0], s[1], s[2]})) / c.gaussians.means[static_cast<std::size_t>(3 * k + 2)] / kSide;
}

TEST(ScreenSize, OnlyTheLargestShrinkAndToOneSize) {
  const Crowd before = crowd(400);
  Crowd after = before;
  shrink_on_screen(before.gaussians, at_origin(), 0.1f, 5000, std::log(1e-5f), after.log_scales);
  double least = 1e9, most = 0;
  for (int k = 0; k < 400; ++k) {
    if (k % 2 == 0) {
      EXPECT_EQ(after.log_scales[static_cast<std::size_t>(3 * k)], before.log_scales[static_cast<std::size_t>(3 * k)]);
      continue;
    }
    EXPECT_LT(widths(after, k), 0.3 * widths(before, k));
    least = std::min(least, widths(after, k));
    most = std::max(most, widths(after, k));
  }
  EXPECT_LT(most, 1.6 * least);  // off the axis they extend farther
  // Gaussians that touch few tiles, and those that no camera sees, stay unchanged.
  Crowd same = before;
  shrink_on_screen(before.gaussians, at_origin(), 0.1f, 10'000'000, std::log(1e-5f), same.log_scales);
  EXPECT_EQ(same.log_scales, before.log_scales);
  same = before;
  shrink_on_screen(before.gaussians, at_origin(), 5, 100, std::log(1e-5f), same.log_scales);
  EXPECT_EQ(same.log_scales, before.log_scales) << "all are nearer than the near plane";
}

// A fit whose Gaussians have grown too large in front of the camera: the step shrinks them, and the next step is
// normal.
TEST(ScreenSize, AStepIsBounded) {
  Context& ctx = test::context(Flavour::cpu);
  const Crowd from = crowd(6000);
  Gaussians g;
  g.count = 6000;
  g.means = from.gaussians.means;
  for (const float s : from.log_scales) g.scales.push_back(std::exp(s));
  for (std::size_t k = 0; k < g.count; ++k) g.quats.insert(g.quats.end(), {1, 0, 0, 0});
  g.opacities.assign(g.count, 0.5f);
  g.sh.assign(3 * g.count, 0.1f);
  const Camera camera = at_origin();
  const FitPicture picture{"grey", camera, std::vector<std::uint8_t>(4 * kSide * kSide, 200), {}, false};
  const auto touched = [&](const Gaussians& now) {
    RenderOptions how;
    how.near = 0.1f;
    std::uint64_t out = 0;
    for_each_part(ctx, upload(ctx, now), camera, how, false,
                  [&](Context& c, const Part&, const Projected&, const Binned& binned) {
                    if (&c == &ctx) out += static_cast<std::uint64_t>(binned.ids.count());
                  });
    return out;
  };
  const std::uint64_t most = affordable_tiles(camera, 6000);
  ASSERT_GT(touched(g), most);
  Fitter fitter(ctx, g, 0.1f, {}, {});
  fitter.step(upload(ctx, picture));
  const Gaussians after = fitter.gaussians();
  EXPECT_LE(touched(after), most);
  EXPECT_GT(touched(after), most / 8) << "no smaller than they have to be";
  ASSERT_EQ(after.count, g.count);
  for (std::size_t k = 0; k < g.count; k += 2)
    EXPECT_NEAR(after.scales[3 * k], g.scales[3 * k], 0.02 * g.scales[3 * k]);
}

}  // namespace
}  // namespace vsplat

#include "model/fit/density/density.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "model/fit/fitter.h"
#include "runtime/fail.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

constexpr float kDensityNear = 0.05f;
constexpr int kDensitySize = 40;

class DensityTest : public test::FlavourTest {
 protected:
  static Gaussians scene(std::size_t count, std::uint32_t seed) {
    Gaussians g = test::make_scene({"", count, 1, 0, 0, ""}, seed);
    for (float& v : g.means) v *= 0.5f;
    for (float& v : g.scales) v *= 3;
    return g;
  }

  Picture drawn(const Gaussians& g, const Camera& camera) {
    RenderOptions how;
    how.near = kDensityNear;
    return render_picture(ctx(), vsplat::upload(ctx(), g), camera, how);
  }

  // What is drawn of `g`, over white and without alpha.
  std::vector<FitPicture> pictures_of(const Gaussians& g, int count) {
    std::vector<FitPicture> out;
    for (const Camera& camera : test::orbit(count, kDensitySize)) {
      FitPicture picture{"", camera, {}, {}, false};
      const Picture p = drawn(g, camera);
      for (std::size_t i = 0; i < p.colour.data.size(); ++i) {
        picture.rgba.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(p.colour.data[i], 0.0f, 1.0f))));
        if (i % 3 == 2) picture.rgba.push_back(255);
      }
      out.push_back(picture);
    }
    return out;
  }

  std::vector<DeviceFitPicture> uploaded(const std::vector<FitPicture>& pictures) {
    std::vector<DeviceFitPicture> out;
    out.reserve(pictures.size());
    for (const FitPicture& p : pictures) out.push_back(upload(ctx(), p));
    return out;
  }

  std::vector<float> gradient(Fitter& fitter) {
    const GaussianGradients g = fitter.gradient();
    std::vector<float> out;
    for (const Tensor& t : {g.means, g.scales, g.quats, g.opacities, g.sh}) {
      const auto values = ctx().read<float>(t);
      out.insert(out.end(), values.begin(), values.end());
    }
    return out;
  }
};
VSPLAT_FLAVOURS(DensityTest);

FitOptions growing(DensityStrategy density) {
  FitOptions options;
  options.density = density;
  options.ssim_weight = 0.2f;
  options.grow_every = 7, options.grow_until = 100, options.max_gaussians = 60;
  return options;
}

// Scores take nothing from the gradient, nor do they add to it.
TEST_P(DensityTest, ScoresLeaveTheGradientsBits) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 2));
  Fitter plain(ctx(), scene(40, 2), kDensityNear, {}, growing(DensityStrategy::mcmc));
  Fitter scored(ctx(), scene(40, 2), kDensityNear, {}, growing(DensityStrategy::error));
  for (const DeviceFitPicture& picture : pictures) {
    plain.differentiate(picture), scored.differentiate(picture);
    EXPECT_EQ(gradient(plain), gradient(scored));
    plain.move(), scored.move();
  }
  EXPECT_EQ(plain.state().count("scores"), 0U);
}

// Over all Gaussians the weights in a pixel add up to its alpha, and scores to the error times alpha.
TEST_P(DensityTest, WeightsAndScoresAddUpToThePictures) {
  const Gaussians g = scene(40, 2);
  const auto given = pictures_of(scene(12, 1), 2);
  const auto pictures = uploaded(given);
  Fitter fitter(ctx(), g, kDensityNear, {}, growing(DensityStrategy::error));
  const Tensor sums = ctx().tensor({40}, Type::f32, "sums");
  ctx().fill_zero(sums);
  double alpha = 0, error = 0;
  for (std::size_t v = 0; v < 2; ++v) {
    fitter.add_weights(pictures[v].camera, sums);
    const Picture p = drawn(fitter.gaussians(), given[v].camera);
    for (std::size_t i = 0; i < p.alpha.data.size(); ++i) {
      alpha += p.alpha.data[i];
      for (std::size_t c = 0; c < 3 && v == 0; ++c)
        error += p.alpha.data[i] / 3 *
                 std::abs(std::clamp(p.colour.data[3 * i + c], 0.0f, 1.0f) - given[v].rgba[4 * i + c] / 255.0);
    }
  }
  const auto total = [](const std::vector<float>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0);
  };
  EXPECT_NEAR(total(ctx().read<float>(sums)), alpha, 1e-3 * alpha);
  for (const float v : gradient(fitter)) ASSERT_EQ(v, 0.0f);
  fitter.step(pictures[0]);
  EXPECT_NEAR(total(fitter.state().at("scores").data), error, 1e-3 * error);
}

// Two equal Gaussians: the one whose place in the picture is wrong is split.
TEST_P(DensityTest, WhatCoversTheErrorIsSplit) {
  Gaussians two;
  two.count = 2;
  two.means = {-0.25f, 0, 0, 0.25f, 0, 0};
  two.scales = {0.05f, 0.02f, 0.02f, 0.05f, 0.02f, 0.02f};
  two.quats = {1, 0, 0, 0, 1, 0, 0, 0};
  two.opacities = {0.8f, 0.8f};
  two.sh.assign(6, 0.0f);
  Gaussians other = two;
  for (std::size_t c = 3; c < 6; ++c) other.sh[c] = 1;
  const auto pictures = uploaded(pictures_of(other, 3));
  FitOptions options = growing(DensityStrategy::error);
  options.rates = {0, 0, 0, 0, 0, 0};
  options.grow_every = 3, options.max_gaussians = 3, options.growth = 1.5;
  Fitter fitter(ctx(), two, kDensityNear, {}, options);
  for (const DeviceFitPicture& picture : pictures) fitter.step(picture);
  ASSERT_EQ(fitter.count(), 3);
  const Gaussians after = fitter.gaussians();
  EXPECT_TRUE(test::close(after.means, std::vector<double>{-0.25, 0, 0, 0.225, 0, 0, 0.275, 0, 0}, 1e-5));
  EXPECT_NEAR(after.opacities[0], 0.8, 1e-5);
  EXPECT_NEAR(after.opacities[1], 1 - std::sqrt(0.2), 1e-5);
  const FitTensors state = fitter.state();
  for (const float score : state.at("scores").data) EXPECT_EQ(score, 0.0f);
}

// A Gaussian that covers the picture is split before all others, even where there is no error.
TEST_P(DensityTest, WhatCoversMoreThanHalfOfAPictureIsSplitFirst) {
  Gaussians g = scene(20, 2);
  for (std::size_t i = 0; i < 3; ++i) g.means[i] = 0, g.scales[i] = 0.45f;
  g.opacities[0] = 0.5f;
  const auto pictures = uploaded(pictures_of(scene(12, 1), 1));
  Fitter fitter(ctx(), g, kDensityNear, {}, growing(DensityStrategy::error));
  fitter.step(pictures[0]);
  const auto scores = fitter.state().at("scores").data;
  EXPECT_EQ(std::max_element(scores.begin(), scores.end()), scores.begin());
  EXPECT_GT(scores[0], 0.99e30f);
  EXPECT_LT(*std::max_element(scores.begin() + 1, scores.end()), 1e6f);
}

// Interrupted between two rounds of growth: scores are part of the state.
TEST_P(DensityTest, RestoredBetweenRoundsItGoesOnWithTheSameBits) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 4));
  const FitOptions options = growing(DensityStrategy::error);
  const auto steps = [&](Fitter& fitter, long until) {
    while (fitter.steps_done() < until) fitter.step(pictures[static_cast<std::size_t>(fitter.steps_done() % 4)]);
  };
  Fitter whole(ctx(), scene(40, 2), kDensityNear, {}, options), first(ctx(), scene(40, 2), kDensityNear, {}, options),
      second(ctx(), scene(40, 2), kDensityNear, {}, options);
  steps(whole, 24);
  steps(first, 12);
  second.restore(first.state(), 12);
  steps(second, 24);
  EXPECT_EQ(whole.count(), 52);
  EXPECT_EQ(second.gaussians().means, whole.gaussians().means);
  EXPECT_EQ(second.gaussians().sh, whole.gaussians().sh);
  FitTensors without = first.state();
  without.erase("scores");
  EXPECT_THROW(second.restore(without, 12), Error);
}

TEST_P(DensityTest, ReplacedGaussiansNoLongerGrow) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 1));
  Fitter fitter(ctx(), scene(40, 2), kDensityNear, {}, growing(DensityStrategy::error));
  for (int i = 0; i < 8; ++i) fitter.step(pictures[0]);
  EXPECT_EQ(fitter.count(), 44);
  const Gaussians fewer = scene(10, 3);
  fitter.replace(fewer);
  EXPECT_TRUE(test::close(fitter.gaussians().means, std::vector<double>(fewer.means.begin(), fewer.means.end()), 1e-6));
  for (int i = 0; i < 8; ++i) fitter.step(pictures[0]);
  EXPECT_EQ(fitter.count(), 10);
  EXPECT_EQ(fitter.replaced_after(), 8);
}

}  // namespace
}  // namespace vsplat

#include "model/reconstruct/inputs_fit.h"

#include <algorithm>

#include "model/base/scene.h"
#include "model/base/scene_edit.h"
#include "model/fit/fit_recipe.h"
#include "model/fit/fitter.h"
#include "model/render/render.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

TEST(InputsFit, MasksMarkTheObjectAndOthersWhatIsKnown) {
  Image colour(2, 1, 3), alpha(2, 1, 1);
  colour.data = {0.6f, 0.8f, 1, 0.2f, 0.4f, 0.6f};  // on white
  alpha.data = {0.4f, 1};
  Camera camera;
  camera.file = "a.png", camera.width = 2, camera.height = 1;
  const FitPicture masked = fit_picture(colour, alpha, true, camera);
  EXPECT_EQ(masked.name, "a.png");
  EXPECT_TRUE(masked.masked);
  EXPECT_EQ(masked.rgba, (std::vector<std::uint8_t>{0, 51, 102, 102, 51, 102, 153, 255}));
  EXPECT_TRUE(masked.known.empty());
  const FitPicture part = fit_picture(colour, alpha, false, camera);
  EXPECT_FALSE(part.masked);
  EXPECT_EQ(part.rgba, (std::vector<std::uint8_t>{153, 204, 255, 255, 51, 102, 153, 255}));
  EXPECT_EQ(part.known, (std::vector<std::uint8_t>{0, 255}));
  EXPECT_TRUE(fit_picture(colour, {}, false, camera).known.empty());
  EXPECT_EQ(fit_picture(colour, {}, true, camera).rgba, part.rgba);
}

class InputsFitTest : public test::FlavourTest {
 protected:
  static constexpr int kSide = 24;

  std::vector<Image> drawn(const Gaussians& g, const std::vector<Camera>& cameras) {
    RenderOptions how;
    how.near = static_cast<float>(kNearInObject);
    std::vector<Image> out;
    out.reserve(cameras.size());
    for (const Camera& camera : cameras) out.push_back(render_picture(ctx(), upload(ctx(), g), camera, how).colour);
    return out;
  }

  double off(const Gaussians& g, const std::vector<Camera>& cameras, const std::vector<Image>& truth) {
    const std::vector<Image> pictures = drawn(g, cameras);
    double sum = 0;
    for (std::size_t i = 0; i < truth.size(); ++i)
      for (std::size_t k = 0; k < truth[i].data.size(); ++k) sum += std::abs(pictures[i].data[k] - truth[i].data[k]);
    return sum;
  }

  static Gaussians scene() {
    Gaussians g = test::make_scene({"", 40, 1, 0, 0, ""}, 7);
    for (float& v : g.means) v *= 0.3f;
    return g;
  }
};

TEST_P(InputsFitTest, StepsOnEveryPictureInTurn) {
  const std::vector<Camera> cameras = test::orbit(3, kSide);
  const Gaussians truth = scene();
  const std::vector<Image> images = drawn(truth, cameras);
  std::vector<FitPicture> pictures;
  for (std::size_t i = 0; i < cameras.size(); ++i) pictures.push_back(fit_picture(images[i], {}, false, cameras[i]));
  Gaussians start = truth;
  for (float& v : start.means) v += 0.02f;
  for (float& v : start.sh) v *= 0.5f;

  std::vector<double> shares;
  InputsFit fit{100, {}, [&](double done) { shares.push_back(done); }};
  const Gaussians got = fitted_to_inputs(ctx(), start, pictures, fit);
  EXPECT_LT(off(got, cameras, images), 0.7 * off(start, cameras, images));
  EXPECT_EQ(shares.size(), 100U);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares.front(), 0);

  // Half of the steps with a weight on opacities, then the others without, on what is not faint.
  const auto steps = [&](const Gaussians& from, const FitOptions& options, std::size_t first) {
    Fitter fitter(ctx(), from, static_cast<float>(kNearInObject), {}, options);
    for (std::size_t step = first; step < first + 150; ++step) fitter.step(upload(ctx(), pictures[step % 3]));
    return fitter.gaussians();
  };
  Gaussians expected = steps(start, options_to_thin_out(), 0);
  const std::size_t before = expected.count;
  keep(expected, [&, opacities = expected.opacities](std::size_t k) { return opacities[k] >= 0.1f; });
  EXPECT_LT(expected.count, before);
  expected = steps(expected, options_for_predicted(), 150);
  EXPECT_EQ(got.means, expected.means);
  EXPECT_EQ(got.sh, expected.sh);
}

double median(std::vector<float> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

TEST_P(InputsFitTest, FewOpaqueGaussiansReplaceManyFaintOnes) {
  const std::vector<Camera> cameras = test::orbit(3, kSide);
  Gaussians truth = scene();
  for (float& v : truth.opacities) v = 0.9f;
  const std::vector<Image> images = drawn(truth, cameras);
  std::vector<FitPicture> pictures;
  for (std::size_t i = 0; i < cameras.size(); ++i) pictures.push_back(fit_picture(images[i], {}, false, cameras[i]));
  Gaussians start = truth;
  for (float& v : start.opacities) v = 0.15f;
  const Gaussians layer = start;
  for (int i = 0; i < 5; ++i) append(start, layer);
  const Gaussians got = fitted_to_inputs(ctx(), start, pictures, {80, {}, {}});

  Fitter fitter(ctx(), start, static_cast<float>(kNearInObject), {}, options_to_thin_out());  // in all steps
  for (std::size_t step = 0; step < 240; ++step) fitter.step(upload(ctx(), pictures[step % 3]));
  const Gaussians thinned = fitter.gaussians();
  EXPECT_LT(got.count, 0.6 * static_cast<double>(thinned.count));
  EXPECT_GT(median(got.opacities), 1.5 * median(thinned.opacities));
  EXPECT_LT(off(got, cameras, images), off(start, cameras, images));
}

TEST_P(InputsFitTest, AFaintSceneStays) {
  const std::vector<Camera> cameras = test::orbit(1, kSide);
  Gaussians start = scene();
  for (float& v : start.opacities) v = 0.03f;
  const FitPicture picture = fit_picture(drawn(start, cameras)[0], {}, false, cameras[0]);
  EXPECT_EQ(fitted_to_inputs(ctx(), start, {picture}, {4, {}, {}}).count, start.count);
}

TEST_P(InputsFitTest, WhatFadesCompletelyLeavesAnEmptyScene) {
  const std::vector<Camera> cameras = test::orbit(1, kSide);
  Gaussians start = scene();
  for (float& v : start.opacities) v = 0.006f;  // a little above what is drawn
  Image white(kSide, kSide, 3);
  std::fill(white.data.begin(), white.data.end(), 1.0f);
  const FitPicture picture = fit_picture(white, {}, false, cameras[0]);
  EXPECT_EQ(fitted_to_inputs(ctx(), start, {picture}, {200, {}, {}}).count, 0U);
}

TEST_P(InputsFitTest, WithoutEpochsOrPicturesTheStartStays) {
  const std::vector<Camera> cameras = test::orbit(1, kSide);
  const Gaussians start = scene();
  const FitPicture picture = fit_picture(drawn(start, cameras)[0], {}, false, cameras[0]);
  FitPicture unknown = picture;
  unknown.known.assign(static_cast<std::size_t>(kSide) * kSide, 0);
  EXPECT_EQ(fitted_to_inputs(ctx(), start, {picture}, {0, {}, {}}).means, start.means);
  EXPECT_EQ(fitted_to_inputs(ctx(), start, {unknown}, {5, {}, {}}).means, start.means);
  EXPECT_NE(fitted_to_inputs(ctx(), start, {picture}, {5, {}, {}}).means, start.means);
  Gaussians none;
  none.sh_degree = 1;
  EXPECT_EQ(fitted_to_inputs(ctx(), none, {picture}, {5, {}, {}}).count, 0U);
}

TEST_P(InputsFitTest, ThePlanHoldsTheMemoryOfAStep) {
  const std::vector<Camera> cameras = test::orbit(1, kSide);
  const Gaussians start = test::make_scene({"", 30000, 1, 0, 0, ""}, 7);
  const FitPicture picture = fit_picture(drawn(start, cameras)[0], {}, false, cameras[0]);
  const auto planner = ctx().planner();
  plan_inputs_fit(*planner, static_cast<long>(start.count), start.sh_degree, kSide);
  const auto planned = static_cast<double>(planner->memory().peak());
  const auto fits = [&](double bytes) {
    ContextOptions limited;
    limited.max_memory_gib = bytes / (1 << 30);
    try {
      fitted_to_inputs(*test::open_context(GetParam(), limited), start, {picture}, {2, {}, {}});
      return true;
    } catch (const Error& e) {
      EXPECT_EQ(e.status(), Status::memory);
      return false;
    }
  };
  constexpr double slab = 4 << 20;
  EXPECT_TRUE(fits(planned + 2 * slab));
  EXPECT_FALSE(fits(0.5 * planned));
}

VSPLAT_FLAVOURS(InputsFitTest);

}  // namespace
}  // namespace vsplat

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <vector>

#include "model/fit/fit_plan.h"
#include "model/fit/scene_fit.h"
#include "tests/support/refusal.h"
#include "tests/support/scene_fit_pictures.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::SceneFitTest;

// Gaussians that no camera sees are not in the result, whose figures are those of what is returned.
TEST_F(SceneFitTest, WhatNoPictureMissesGoes) {
  make(13);
  Gaussians& g = start_.gaussians;
  const std::size_t hidden = 20;  // behind the cameras
  for (std::size_t k = 0; k < hidden; ++k) {
    for (std::size_t i = 0; i < 3; ++i) g.means.push_back(k % 2 == 0 ? 40.0f : -40.0f), g.scales.push_back(0.01f);
    for (const float q : {1.0f, 0.0f, 0.0f, 0.0f}) g.quats.push_back(q);
    g.opacities.push_back(0.9f);
    for (std::size_t i = 0; i < 3; ++i) g.sh.push_back(0.0f);
    ++g.count;
  }
  for (const auto kind : {FitHoldout::Kind::automatic, FitHoldout::Kind::none}) {
    FitRequest request;
    request.holdout.kind = kind;
    request.steps = 40;
    request.max_gaussians = 80;
    SceneFit fit(ctx(), photographs_, start(), request);
    while (fit.step()) {
    }
    const FitResult result = fit.result();
    EXPECT_EQ(result.steps, 40);
    EXPECT_EQ(fit.progress().gaussians, static_cast<long>(result.scene.gaussians.count));
    EXPECT_LE(result.scene.gaussians.count, 60U);
    EXPECT_GT(result.scene.gaussians.count, 20U);
    for (const float v : result.scene.gaussians.means) EXPECT_LT(std::abs(v), 5);
    if (kind == FitHoldout::Kind::none) continue;
    double psnr = 0;
    for (const int view : result.held_out) {
      RenderOptions how;
      how.near = result.scene.near;
      const Picture drawn = render_picture(ctx(), upload(ctx(), result.scene.gaussians), fit.camera(view), how);
      const Image given = fit.picture(view);
      double sum = 0;
      for (std::size_t i = 0; i < given.data.size(); ++i)
        sum += std::pow(std::clamp(drawn.colour.data[i], 0.0f, 1.0f) - given.data[i], 2);
      psnr -= 10 * std::log10(sum / static_cast<double>(given.data.size()));
    }
    EXPECT_NEAR(psnr / static_cast<double>(result.held_out.size()), result.result.psnr, 0.01);
  }
}

// What stays is more than the 60 Gaussians that the pictures show: a smaller share would leave holes.
TEST_F(SceneFitTest, AConsolidationKeepsTheShareThatIsAskedFor) {
  make(12);
  FitRequest request;
  request.steps = 80;
  request.max_gaussians = 120;
  const std::size_t all = run(request).scene.gaussians.count;
  request.consolidate = 0.9;
  const auto run_to = [&](long steps, const FitRequest& wanted) {
    SceneFit fit(ctx(), photographs_, start(), wanted);
    for (long i = 0; i < steps && fit.step(); ++i) {
    }
    return fit.progress();
  };
  const FitProgress before = run_to(60, request), after = run_to(61, request);
  EXPECT_EQ(before.steps, 80);
  EXPECT_EQ(before.phase, "fitting");
  EXPECT_EQ(after.phase, "consolidating");
  EXPECT_LE(static_cast<double>(after.gaussians), std::ceil(0.9 * static_cast<double>(before.gaussians)));
  const FitResult want = run(request);
  ASSERT_GT(want.steps, 60);
  EXPECT_LE(want.scene.gaussians.count, static_cast<std::size_t>(after.gaussians));
  EXPECT_LT(want.scene.gaussians.count, all);
  EXPECT_GT(want.result.psnr, want.start.psnr);
  for (const long left_at : {59L, 65L, 79L}) {
    const test::TemporaryFolder folder;
    FitRequest kept = request;
    kept.checkpoint = folder.path();
    run_to(left_at, kept);
    kept.resume = true;
    const FitResult got = run(kept);
    EXPECT_EQ(got.scene.gaussians.means, want.scene.gaussians.means) << left_at;
    EXPECT_EQ(got.scene.gaussians.sh, want.scene.gaussians.sh) << left_at;
    EXPECT_EQ(got.result.psnr, want.result.psnr);
  }
  request.names = {"picture 0", "picture 1", "picture 2"};
  test::expect_error(Status::usage, {"12 views", "3 are used"}, [&] { run(request); });
}

// It makes what stays thicker, unless opacities are frozen.
TEST_F(SceneFitTest, AConsolidationThickensWhatStays) {
  make(12);
  std::fill(start_.gaussians.opacities.begin(), start_.gaussians.opacities.end(), 0.1f);
  for (const bool frozen : {false, true}) {
    FitRequest request;
    request.steps = 4;
    request.holdout.kind = FitHoldout::Kind::none;
    request.consolidate = 0.9;
    request.freeze.opacities = frozen;
    std::vector<float> opacities = run(request).scene.gaussians.opacities;
    ASSERT_FALSE(opacities.empty());
    std::sort(opacities.begin(), opacities.end());
    EXPECT_NEAR(opacities[opacities.size() / 2], frozen ? 0.1 : 0.55, frozen ? 1e-6 : 0.1);
  }
}

// As many as the memory allows, and hardly fewer.
TEST_F(SceneFitTest, GrowthIsLimitedByTheMemory) {
  make(1);
  ContextOptions little;
  little.max_memory_gib = 0.1;
  const auto tight = test::open_context(Flavour::cpu, little);
  const Camera camera = photographs_.set.views[0].camera;
  FitOptions options;
  options.grow_every = 1;
  const auto peak_of = [&](long most) {
    options.max_gaussians = most;
    return plan_fit(*tight, start_.gaussians, start_.near, options, camera).peak;
  };
  options.max_gaussians = 1000;
  EXPECT_EQ(affordable_gaussians(*tight, start_.gaussians, start_.near, options, camera), 1000);
  options.max_gaussians = 1000000;
  const long most = affordable_gaussians(*tight, start_.gaussians, start_.near, options, camera);
  const std::size_t limit = tight->memory().limits().total;
  EXPECT_LE(peak_of(most), limit);
  test::expect_error(Status::memory, {"not enough device memory"}, [&] {
    options.max_gaussians = most + 1000000 / 32;
    fit_budget(*tight, start_.gaussians, start_.near, options, camera);
  });
}

}  // namespace
}  // namespace vsplat

// Fits for which there is less memory than they would use.
#include <algorithm>
#include <utility>

#include "model/base/scene_edit.h"
#include "model/fit/fit_plan.h"
#include "model/fit/scene_fit.h"
#include "runtime/system/host_memory.h"
#include "tests/support/refusal.h"
#include "tests/support/scene_fit_pictures.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::kSceneFitSize;
using test::SceneFitTest;

FitResult run_to_end(SceneFit& fit) {
  while (fit.step()) {
  }
  return fit.result();
}

void expect_same(const FitResult& got, const FitResult& want) {
  EXPECT_EQ(got.steps, want.steps);
  EXPECT_EQ(got.scene.gaussians.means, want.scene.gaussians.means);
  EXPECT_EQ(got.scene.gaussians.sh, want.scene.gaussians.sh);
  EXPECT_EQ(got.result.psnr, want.result.psnr);
}

class SceneFitMemoryTest : public SceneFitTest {
 protected:
  ~SceneFitMemoryTest() override { set_host_memory_limit(0); }

  // Bytes of device memory with so many Gaussians.
  std::size_t peak_of(long count) {
    Gaussians g = start_.gaussians;
    set_degree(g, 2);
    FitOptions options;
    options.grow_every = 1;
    options.ssim_weight = 0.2f;
    options.max_gaussians = count;
    const auto fresh = test::open_context(Flavour::cpu);
    return plan_fit(*fresh, g, start_.near, options, photographs_.set.views[0].camera).peak;
  }
};

// The limit is found once: a fit that goes on in more memory, or after growth has ended, gives the same scene.
TEST_F(SceneFitMemoryTest, GrowthThatMemoryLimitsGoesOnToTheSameBits) {
  make(12);
  FitRequest request;
  request.steps = 240;  // Gaussians are added after 50, 100 and 150 steps, the state is saved after 100 and 200
  request.consolidate = 1;
  ContextOptions little;
  little.max_memory_gib = static_cast<double>(peak_of(130)) / (1 << 30);
  const auto tight = test::open_context(Flavour::cpu, little);
  FitResult want;
  long most = 0;
  {
    const test::Warnings warnings;
    SceneFit fit(*tight, photographs_, start(), request);
    EXPECT_NE(warnings.text().find("as many as"), std::string::npos) << warnings.text();
    while (fit.step()) most = std::max(most, fit.progress().gaussians);
    want = fit.result();
  }
  ASSERT_GT(most, 60);
  {
    SceneFit free(ctx(), photographs_, start(), request);
    long more = 0;
    while (free.step()) more = std::max(more, free.progress().gaussians);
    ASSERT_GT(more, 2 * most);  // so it is limited
  }
  for (const long left_at : {40L, 120L, 230L})
    for (Context* other : {tight.get(), &ctx()}) {
      if (left_at == 40 && other != tight.get()) continue;  // nothing is saved yet
      const test::TemporaryFolder folder;
      FitRequest kept = request;
      kept.checkpoint = folder.path();
      {
        SceneFit fit(*tight, photographs_, start(), kept);
        for (long i = 0; i < left_at; ++i) fit.step();
      }
      kept.resume = true;
      SceneFit fit(*other, photographs_, start(), kept);
      expect_same(run_to_end(fit), want);
    }
}

TEST_F(SceneFitMemoryTest, WithoutRoomForPicturesTheyAreReadAgain) {
  make(12);
  FitRequest request;
  request.steps = 60;
  request.max_gaussians = 20000;
  std::size_t asked = 0;
  photographs_.picture = [&](int view) {
    ++asked;
    return pictures_.at(static_cast<std::size_t>(view));
  };
  const auto fresh = test::open_context(Flavour::cpu);
  SceneFit ample(*fresh, photographs_, start(), request);
  const FitBudget planned = ample.memory();
  const FitResult want = run_to_end(ample);
  EXPECT_LE(fresh->memory().peak(), planned.fit.peak + planned.on_device);
  EXPECT_LT(asked, 40U);
  // The plan takes all; what is added is for the least that a device's buffer takes.
  const auto tight = test::open_context(Flavour::cpu);
  const std::size_t slack = std::size_t{8} << 20;
  ASSERT_GT(planned.host, slack);
  set_host_memory_limit(reserved_host_memory() + planned.fit.peak + slack);
  asked = 0;
  {
    SceneFit fit(*tight, photographs_, start(), request);
    expect_same(run_to_end(fit), want);
  }
  set_host_memory_limit(0);
  if (tight->memory().limits().on_host) {
    EXPECT_GT(asked, 60U);
  }
}

// The plan assumes eight tiles for each Gaussian. There is no memory for these, which touch all of them.
TEST_F(SceneFitMemoryTest, WhatTouchesManyTilesIsDrawnInParts) {
  make(12);
  const double larger = 8;
  for (std::size_t v = 0; v < pictures_.size(); ++v) {
    Camera& camera = photographs_.set.views[v].camera;
    camera.width = camera.height = static_cast<int>(larger * kSceneFitSize);
    for (double* length : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *length *= larger;
    pictures_[v] = Image(camera.width, camera.height, 3, 0.2f);
  }
  for (int i = 0; i < 5; ++i) append(start_, Scene(start_), {});
  for (float& scale : start_.gaussians.scales) scale = 0.4f;
  FitRequest request;
  request.steps = 3;
  request.max_gaussians = static_cast<long>(start_.gaussians.count);
  const auto fresh = test::open_context(Flavour::cpu);
  SceneFit ample(*fresh, photographs_, start(), request);
  const FitBudget planned = ample.memory();
  const FitResult want = run_to_end(ample);
  ASSERT_GT(fresh->memory().peak(), planned.fit.peak + (std::size_t{8} << 20));
  const auto tight = test::open_context(Flavour::cpu);
  set_host_memory_limit(reserved_host_memory() + planned.fit.peak + static_cast<std::size_t>(planned.host) +
                        (std::size_t{4} << 20));
  SceneFit fit(*tight, photographs_, start(), request);
  const FitResult got = run_to_end(fit);
  EXPECT_EQ(got.steps, want.steps);
  expect_finite(got.scene);
  EXPECT_NEAR(got.result.psnr, want.result.psnr, 0.05);
}

TEST_F(SceneFitMemoryTest, TheHostsMemoryIsSharedWithItsDevice) {
  make(1);
  const Camera camera = photographs_.set.views[0].camera;
  const auto fresh = test::open_context(Flavour::cpu);
  FitOptions options;
  options.grow_every = 1;
  options.max_gaussians = 20000;
  const auto budget_at = [&](double bytes) {
    set_host_memory_limit(reserved_host_memory() + static_cast<std::size_t>(bytes));
    const FitBudget out = fit_budget(*fresh, start_.gaussians, start_.near, options, camera);
    const long most = affordable_gaussians(*fresh, start_.gaussians, start_.near, options, camera);
    set_host_memory_limit(0);
    return std::pair(out, most);
  };
  const auto [ample, all] = budget_at(8.0 * (1u << 30));
  EXPECT_EQ(all, 20000);
  EXPECT_EQ(ample.on_host, kMostCached);
  const double whole = static_cast<double>(ample.fit.peak) + ample.host;
  const bool shared = fresh->memory().limits().on_host;
  const auto [some, still_all] = budget_at(whole + 1000);
  const auto [none, fewer] = budget_at(0.7 * whole);
  if (!shared) return;
  EXPECT_EQ(still_all, 20000);
  EXPECT_LE(some.on_device + some.on_host, 1000U);
  EXPECT_GT(some.on_host, 300U);
  EXPECT_EQ(none.on_device + none.on_host, 0U);
  EXPECT_LT(fewer, 15000);
  EXPECT_GT(fewer, 10000);
}

}  // namespace
}  // namespace vsplat

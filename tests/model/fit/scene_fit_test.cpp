#include "model/fit/scene_fit.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <thread>

#include "model/base/resample.h"
#include "model/fit/outliers.h"
#include "tests/support/refusal.h"
#include "tests/support/scene_fit_pictures.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::SceneFitTest;

TEST_F(SceneFitTest, FewViewsAreEachLeftOutAndThenAllFitted) {
  make(4);
  FitRequest request;
  const FitResult result = run(request);
  const std::vector<std::vector<int>> want = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}, {0, 1, 2, 3}};
  EXPECT_EQ(asked_, want);
  EXPECT_EQ(result.held_out, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_GT(result.steps, 0);
  EXPECT_GT(result.result.psnr, result.start.psnr + 0.5);
  EXPECT_FALSE(result.start_returned);
  EXPECT_EQ(result.steps % 25, 0);
  expect_finite(result.scene);
}

// Dark and light pictures of a grey object: whichever is held out, the others lead away from it.
TEST_F(SceneFitTest, ARoundEndsOnceItsMeasureHasFallenTwice) {
  make(4);
  start_ = truth_;
  std::fill(start_.gaussians.sh.begin(), start_.gaussians.sh.end(), 0.0f);
  for (std::size_t v = 0; v < 4; ++v)
    for (std::size_t i = 0; i < pictures_[v].data.size(); ++i)
      if (i % 4 < 3) pictures_[v].data[i] = v % 2 == 0 ? 0.2f : 0.8f;
  SceneFit fit(ctx(), photographs_, start(), {});
  std::map<std::string, long> steps;
  do {
    const FitProgress p = fit.progress();
    steps[p.phase] = std::max(steps[p.phase], p.step);
  } while (fit.step());
  for (const char* round : {"leaving out 1 of 4", "leaving out 2 of 4", "leaving out 3 of 4", "leaving out 4 of 4"}) {
    EXPECT_GE(steps[round], 49) << round;  // the 50th step ends it
    EXPECT_LE(steps[round], 50) << round;
  }
  EXPECT_TRUE(fit.result().start_returned);
  EXPECT_LT(fit.result().result.psnr, fit.result().start.psnr);
}

TEST_F(SceneFitTest, OfManyViewsEveryEighthIsHeldOut) {
  make(13);
  FitRequest request;
  request.steps = 120;
  request.max_gaussians = 200;
  const FitResult result = run(request);
  EXPECT_EQ(result.held_out, (std::vector<int>{0, 8}));
  EXPECT_EQ(asked_, (std::vector<std::vector<int>>{{1, 2, 3, 4, 5, 6, 7, 9, 10, 11, 12}}));
  EXPECT_GT(result.result.psnr, result.start.psnr + 2);
  EXPECT_GT(result.scene.gaussians.count, start_.gaussians.count);
  EXPECT_LE(result.scene.gaussians.count, 200U);
  EXPECT_EQ(result.scene.near, start_.near);
}

// A start that cannot be improved is returned bit for bit.
TEST_F(SceneFitTest, AWholeSceneIsTheLastStepsAndHoldsOneOfFiveOut) {
  make(6);
  FitRequest request;
  request.whole = true;
  request.steps = 150;
  const FitResult result = run(request);
  EXPECT_EQ(result.held_out, std::vector<int>{0});
  EXPECT_EQ(result.steps, 150);
  EXPECT_FALSE(result.start_returned);
  EXPECT_GT(result.result.psnr, result.start.psnr + 1);
  EXPECT_EQ(result.scene.gaussians.sh_degree, 3);
  expect_finite(result.scene);
  request.names = {"@0", "@1", "@2", "@3"};
  EXPECT_TRUE(run(request).held_out.empty());
}

TEST_F(SceneFitTest, TheStartIsReturnedWhereItIsBest) {
  make(3);
  start_ = truth_;
  for (std::size_t v = 0; v < 3; ++v) {  // fitting to one does not help the others
    for (float& value : pictures_[v].data) value = v == 0 ? 0.1f : v == 1 ? 0.9f : value;
  }
  FitRequest request;
  request.holdout.kind = FitHoldout::Kind::named;
  request.holdout.names = {"picture 2"};
  request.steps = 30;
  const FitResult result = run(request);
  EXPECT_TRUE(result.start_returned);
  EXPECT_EQ(result.steps, 0);
  EXPECT_EQ(result.scene.gaussians.means, start_.gaussians.means);
  EXPECT_EQ(result.scene.gaussians.sh, start_.gaussians.sh);
  EXPECT_LT(result.result.psnr, result.start.psnr);
}

// Each Gaussian of the start becomes fifty with a fraction of its light, as a network's are.
TEST_F(SceneFitTest, ADenseStartIsMergedIfThereAreManyViews) {
  make(12);
  const Gaussians once = start_.gaussians;
  Gaussians& g = start_.gaussians;
  for (int copy = 1; copy < 50; ++copy)
    for (auto values :
         {&Gaussians::means, &Gaussians::scales, &Gaussians::quats, &Gaussians::opacities, &Gaussians::sh})
      (g.*values).insert((g.*values).end(), (once.*values).begin(), (once.*values).end());
  g.count *= 50;
  for (float& opacity : g.opacities) opacity = 0.03f;
  FitRequest request;
  request.steps = 1;
  const auto begun_with = [&](Predicted predicted) {
    FitStart from = start();
    from.predicted = predicted;
    return SceneFit(ctx(), photographs_, from, request).progress().gaussians;
  };
  EXPECT_EQ(begun_with(Predicted::no), 3000);
  EXPECT_LE(begun_with(Predicted::yes), 60);
  EXPECT_LE(begun_with(Predicted::fitted), 60);
  EXPECT_GT(begun_with(Predicted::yes), 40);
  request.max_gaussians = 20;
  EXPECT_LE(begun_with(Predicted::yes), 20);
  request.max_gaussians = 0;
  request.names = {"@0", "@1", "@2", "@3"};
  EXPECT_EQ(begun_with(Predicted::yes), 3000);
}

TEST_F(SceneFitTest, SameBitsThreeTimesAndAnotherSeedOthers) {
  make(12);
  FitRequest request;
  request.steps = 60;
  request.max_gaussians = 150;
  request.poses = request.exposure = true;
  const FitResult first = run(request), second = run(request), third = run(request);
  EXPECT_EQ(first.scene.gaussians.means, second.scene.gaussians.means);
  EXPECT_EQ(first.scene.gaussians.sh, second.scene.gaussians.sh);
  EXPECT_EQ(first.scene.gaussians.means, third.scene.gaussians.means);
  EXPECT_EQ(first.result.psnr, third.result.psnr);
  request.seed = 1;
  EXPECT_NE(run(request).scene.gaussians.means, first.scene.gaussians.means);
}

TEST_F(SceneFitTest, AntialiasingIsThatOfTheRequestOrOfTheStart) {
  make(12);
  FitRequest request;
  request.steps = 20;
  EXPECT_FALSE(run(request).scene.antialias);
  request.antialias = true;
  EXPECT_TRUE(run(request).scene.antialias);
  EXPECT_TRUE(SceneFit(ctx(), photographs_, start(), request).result().scene.antialias);  // the start is returned
  request.antialias = false;
  start_.antialias = true;
  EXPECT_TRUE(run(request).scene.antialias);
}

// Stopped at any time, the fit continues from its last checkpoint with the same bits.
TEST_F(SceneFitTest, ResumedWithTheSameBits) {
  for (const int views : {3, 12}) {
    SCOPED_TRACE(views);
    photographs_ = {};
    pictures_.clear();
    make(views);
    FitRequest request;
    request.steps = views == 3 ? 0 : 80;
    request.max_gaussians = 150;
    request.poses = request.exposure = true;
    request.antialias = views == 12;
    const FitResult want = run(request);
    for (const long left_at : {1L, 26L, 130L, 333L}) {
      const test::TemporaryFolder folder;
      request.checkpoint = folder.path();
      {
        SceneFit fit(ctx(), photographs_, start(), request);
        for (long i = 0; i < left_at && fit.step(); ++i) {
        }
      }
      FitRequest again = request;
      again.resume = true;
      const FitResult got = run(again);
      EXPECT_EQ(got.scene.gaussians.means, want.scene.gaussians.means) << left_at;
      EXPECT_EQ(got.scene.gaussians.sh, want.scene.gaussians.sh) << left_at;
      EXPECT_EQ(got.steps, want.steps);
      EXPECT_EQ(got.result.psnr, want.result.psnr);
      request.checkpoint.clear();
    }
  }
}

TEST_F(SceneFitTest, WithASkyItResumesToTheSameBits) {
  make(12);
  for (Image& picture : pictures_) picture = over(premultiplied(picture), {0.2f, 0.4f, 0.9f});
  FitRequest request;
  request.steps = 80;
  request.max_gaussians = 150;
  request.exposure = true;
  request.background.kind = FitBackground::Kind::sky;
  const FitResult want = run(request);
  EXPECT_GT(want.result.psnr, want.start.psnr + 1);
  EXPECT_NEAR(want.over_sky.psnr, want.result.psnr, 1);
  EXPECT_GT(want.scene.gaussians.count, static_cast<std::size_t>(kSkyGaussians));
  const test::TemporaryFolder folder;
  request.checkpoint = folder.path();
  {
    SceneFit fit(ctx(), photographs_, start(), request);
    for (int i = 0; i < 71; ++i) fit.step();
  }
  request.resume = true;
  const FitResult got = run(request);
  EXPECT_EQ(got.scene.gaussians.means, want.scene.gaussians.means);
  EXPECT_EQ(got.scene.gaussians.sh, want.scene.gaussians.sh);
  EXPECT_EQ(got.result.psnr, want.result.psnr);
  EXPECT_EQ(got.over_sky.psnr, want.over_sky.psnr);
  request.background.kind = FitBackground::Kind::random;
  test::expect_error(Status::usage, {"another fit"}, [&] { run(request); });
}

TEST_F(SceneFitTest, MasksAndBackgroundsThatCannotBeAreRefused) {
  make(12);
  FitRequest request;
  request.steps = 2;
  request.background.kind = FitBackground::Kind::sky;
  test::expect_error(Status::usage, {"background", "12 of the 12 pictures have a mask or alpha"},
                     [&] { run(request); });
  request.background = {};
  photographs_.masks = MaskUse::ignore;
  test::expect_error(Status::usage, {"masks", "none of the 12 pictures has a mask"}, [&] { run(request); });
  photographs_.masks = MaskUse::object;
  photographs_.invert_masks = true;
  test::expect_error(Status::usage, {"invert_masks", "none of the 12"}, [&] { run(request); });
}

TEST_F(SceneFitTest, AnotherRequestsStateIsRefused) {
  make(12);
  const test::TemporaryFolder folder;
  FitRequest request;
  request.steps = 60;
  request.checkpoint = folder.path();
  run(request);
  test::expect_error(Status::usage, {"refinement.safetensors", "resume"}, [&] { run(request); });
  request.resume = true;
  request.steps = 70;
  test::expect_error(Status::usage, {"refinement.safetensors", "another fit"}, [&] { run(request); });
}

TEST_F(SceneFitTest, AnotherStrategysStateIsRefused) {
  make(12);
  const test::TemporaryFolder folder;
  FitRequest request;
  request.steps = 20;
  request.checkpoint = folder.path();
  request.density = DensityStrategy::mcmc;
  run(request);
  request.resume = true;
  request.density = DensityStrategy::error;
  test::expect_error(Status::usage, {"refinement.safetensors", "another fit"}, [&] { run(request); });
}

TEST_F(SceneFitTest, OneFitKeepsItsStateInAFolder) {
  make(12);
  const test::TemporaryFolder folder;
  FitRequest request;
  request.steps = 60;
  request.checkpoint = folder.path();
  const SceneFit fit(ctx(), photographs_, start(), request);
  test::expect_error(Status::file, {folder.path(), "another process"},
                     [&] { SceneFit(ctx(), photographs_, start(), request); });
}

TEST_F(SceneFitTest, AWrongPoseIsNamed) {
  make(16);
  photographs_.set.views[5].camera = test::orbit(16, test::kSceneFitSize)[7];
  FitRequest request;
  request.steps = 200;
  const FitResult result = run(request);
  EXPECT_EQ(result.outliers, std::vector<int>{5});
}

TEST_F(SceneFitTest, PicturesOfMoreThanTheCubeAreWarnedOf) {
  make(4);
  const auto warned = [&](double edge) {
    const test::Warnings warnings;
    FitStart from = start();
    from.placement.edge = edge;
    const SceneFit fit(ctx(), photographs_, std::move(from), {});
    return warnings.text();
  };
  EXPECT_EQ(warned(0.3), "");
  for (Image& picture : pictures_)
    picture = Image(test::kSceneFitSize, test::kSceneFitSize, 3);  // black, without alpha
  EXPECT_NE(warned(0.3).find("4 of the 4 pictures have neither mask nor alpha"), std::string::npos) << warned(0.3);
  for (Image& picture : pictures_) std::fill(picture.data.begin(), picture.data.end(), 1.0f);
  EXPECT_EQ(warned(0.3), "");
}

// The time limit includes measuring and the next step.
TEST_F(SceneFitTest, TimeEndsItBefore) {
  make(12);
  FitRequest request;
  request.steps = 1000000;
  request.seconds = 4;
  SceneFit fit(ctx(), photographs_, start(), request);
  while (fit.step()) {
  }
  EXPECT_GT(fit.result().seconds, 1);
  EXPECT_LT(fit.result().seconds, 5);
  // The last quarter of the steps that the time allowed.
  EXPECT_EQ(fit.progress().phase, "consolidating");
}

// Reading a picture is no part of the expected cost of a measurement, because it is done once.
TEST_F(SceneFitTest, TimeCountsNoPictureTwice) {
  make(16);
  FitRequest request;
  request.steps = 1;
  run(request);  // compiles
  photographs_.picture = [this](int view) {
    if (view % 8 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(600));  // the two that are held out
    return pictures_.at(static_cast<std::size_t>(view));
  };
  request.steps = 1000000;
  request.seconds = 7;
  SceneFit fit(ctx(), photographs_, start(), request);
  while (fit.step()) {
  }
  EXPECT_GT(fit.progress().step, 20);
  EXPECT_LT(fit.result().seconds, 8);
}

// Views are left out in turn only as long as enough time remains to fit all of them.
TEST_F(SceneFitTest, TimeLeavesEnoughForTheFit) {
  make(8);
  FitRequest request;
  request.steps = 0;
  request.seconds = 2;
  const FitResult result = run(request);
  EXPECT_FALSE(result.start_returned);
  EXPECT_GT(result.held_out.size(), 0u);
  EXPECT_GT(result.result.psnr, result.start.psnr);
  EXPECT_LT(result.seconds, 3);
}

TEST_F(SceneFitTest, OneViewIsNotMeasuredAndNotFitted) {
  make(1);
  const FitResult result = run({});
  EXPECT_TRUE(result.start_returned);
  EXPECT_TRUE(result.held_out.empty());
  EXPECT_TRUE(std::isnan(result.result.psnr));
  FitRequest none;
  none.holdout.kind = FitHoldout::Kind::none;
  const FitResult fitted = run(none);
  EXPECT_FALSE(fitted.start_returned);
  EXPECT_GT(fitted.steps, 0);
  expect_finite(fitted.scene);
}

TEST_F(SceneFitTest, ViewsAllAlikeAndMasksAllEmpty) {
  make(4);
  for (ListedView& view : photographs_.set.views) view.camera.w2c = photographs_.set.views[0].camera.w2c;
  for (Image& picture : pictures_) picture = pictures_[0];
  expect_finite(run({}).scene);
  for (Image& picture : pictures_) std::fill(picture.data.begin(), picture.data.end(), 0.0f);
  expect_finite(run({}).scene);
}

TEST_F(SceneFitTest, BadInputIsRefused) {
  make(4);
  FitRequest all;
  all.holdout.kind = FitHoldout::Kind::named;
  all.holdout.names = {"@0", "@1", "@2", "@3"};
  test::expect_error(Status::usage, {"every view is held out"}, [&] { run(all); });
  FitRequest count;
  count.holdout.kind = FitHoldout::Kind::count;
  count.holdout.count = 4;
  test::expect_error(Status::usage, {"holdout_count is 4"}, [&] { run(count); });
  FitRequest unused;
  unused.names = {"@0", "@1"};
  unused.holdout.kind = FitHoldout::Kind::named;
  unused.holdout.names = {"@3"};
  test::expect_error(Status::usage, {"picture 3", "not among"}, [&] { run(unused); });
  pictures_[2].data[7] = std::nanf("");
  test::expect_error(Status::input, {"picture 2", "NaN"}, [&] { run({}); });
  pictures_[2].data[7] = 0;
  start_.gaussians = {};
  test::expect_error(Status::input, {"no Gaussian"}, [&] { run({}); });
}

TEST(Outliers, AreFarBelowTheOthers) {
  const auto scores = [](std::vector<double> psnr) {
    std::vector<FitScore> out(psnr.size());
    for (std::size_t i = 0; i < psnr.size(); ++i) out[i].psnr = psnr[i];
    return out;
  };
  EXPECT_TRUE(find_outliers(scores({30, 31, 10, 30})).empty());  // too few to decide
  EXPECT_EQ(find_outliers(scores({30, 31, 10, 30, 29})), std::vector<std::size_t>{2});
  EXPECT_EQ(find_outliers(scores({30, 15, 10, 30, 29, 31})), (std::vector<std::size_t>{2, 1}));
  EXPECT_TRUE(find_outliers(scores({30, 28, 27, 33, 29})).empty());
  EXPECT_TRUE(find_outliers(scores({20, 35, 25, 30, 15, 40})).empty());  // all differ
}

}  // namespace
}  // namespace vsplat

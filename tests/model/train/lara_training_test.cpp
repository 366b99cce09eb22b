// LaRa's network with the trainer that VS-Splat uses: gradients of the whole loss against PyTorch's, and steps.
#include <gtest/gtest.h>

#include <cmath>

#include "model/networks/params/params.h"
#include "model/train/trainer.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/lara_golden.h"
#include "tests/support/training_views.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::LaraGolden;

TrainingViews views_of(const LaraGolden& golden) {
  TrainingViews out;
  out.object = "golden";
  out.pictures = golden.floats("input.images");
  const std::vector<float> novel = golden.floats("novel.images");
  out.pictures.insert(out.pictures.end(), novel.begin(), novel.end());
  out.cameras = golden.cameras();
  out.cameras.insert(out.cameras.end(), golden.novel().begin(), golden.novel().end());
  out.inputs = static_cast<int>(golden.cameras().size());
  out.background = {1, 1, 1};
  return out;
}

PassViews upload(Context& ctx, const LaraGolden& golden) {
  return test::upload_views_of_step(ctx, views_of(golden), golden.config().image);
}

double loss_of(Context& ctx, const PassResult& result) {
  double loss = 0;
  for (const LevelLoss& level : {result.coarse, result.final})
    for (const Tensor& view : level)
      loss += static_cast<double>(ctx.read<float>(view)[0]) / static_cast<double>(level.size());
  return loss;
}

// All gradients of one pass, in the state dict's order.
std::map<std::string, std::vector<float>> gradients(Context& ctx, const LaraGolden& golden, const PassOptions& options,
                                                    double* loss = nullptr) {
  const LearntWeights weights(ctx, parameters(golden.config()), golden.weights());
  const auto network = make_network(ctx, golden.config(), weights);
  const PassResult result = training_pass(ctx, *network, upload(ctx, golden), options);
  if (loss) *loss = loss_of(ctx, result);
  EXPECT_EQ(result.final.empty(), !options.forward.fine);
  std::map<std::string, std::vector<float>> out;
  for (const std::string& name : weights.names()) out[name] = ctx.read<float>(weights.at(name).gradient);
  return out;
}

class LaraTraining : public test::FlavourTest {};
VSPLAT_FLAVOURS(LaraTraining);

class LaraTrainingVectors : public test::VectorsTest {};
VSPLAT_VECTORS(LaraTrainingVectors, test::lara_cases());
VSPLAT_SLOW_VECTORS(LaraTrainingVectors, test::slow_lara_cases());

PassOptions whole_loss(const LaraGolden& golden) {
  PassOptions out;
  if (golden.config().kind == "surfel") out.surface = {1000, 0.2f};
  return out;
}

void expect_like_pytorch(const LaraGolden& golden, double loss,
                         const std::map<std::string, std::vector<float>>& gradients) {
  EXPECT_NEAR(loss, golden.floats("loss")[0], 1e-4);
  double error = 0, norm = 0;
  for (const auto& [name, got] : gradients) {
    ASSERT_TRUE(golden.has("grad." + name)) << name;
    const std::vector<float> want = golden.floats("grad." + name);
    ASSERT_EQ(got.size(), want.size());
    for (std::size_t i = 0; i < got.size(); ++i) {
      ASSERT_TRUE(std::isfinite(got[i])) << name;
      error += std::pow(static_cast<double>(got[i]) - want[i], 2);
      norm += std::pow(static_cast<double>(want[i]), 2);
    }
  }
  EXPECT_GT(norm, 0);
  EXPECT_LE(std::sqrt(error / norm), 1e-2);
}

TEST_P(LaraTraining, GradientsOfTheLossMatch) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  double loss = 0;
  const auto got = gradients(ctx(), golden, whole_loss(golden), &loss);
  expect_like_pytorch(golden, loss, got);
  for (const auto& [weight, values] : got)
    EXPECT_TRUE(test::close(values, golden.floats("grad." + weight), 1e-4)) << weight;
}

// All gradients are compared together, since a flipped pixel changes single ones.
TEST_P(LaraTrainingVectors, GradientsOfTheLossMatch) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const LaraGolden golden = LaraGolden::load(name());
  double loss = 0;
  const auto got = gradients(ctx(), golden, whole_loss(golden), &loss);
  expect_like_pytorch(golden, loss, got);
}

// Until the second level begins, the fine decoder has no gradient; afterwards all gradients change.
TEST_P(LaraTraining, WithoutTheSecondLevel) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  PassOptions options = whole_loss(golden);
  const auto both = gradients(ctx(), golden, options);
  options.forward.fine = false;
  const auto one = gradients(ctx(), golden, options);
  options.surface = {};
  const auto bare = gradients(ctx(), golden, options);
  for (const auto& [name, values] : one) {
    const bool fine = name.starts_with("decoder.norm") || name.starts_with("decoder.cross_att") ||
                      name.starts_with("decoder.mlp_fine");
    EXPECT_EQ(values == std::vector<float>(values.size(), 0.0f), fine) << name;
    if (fine) continue;
    EXPECT_NE(values, both.at(name)) << name;
    EXPECT_NE(values, bare.at(name)) << name;
  }
}

TEST_P(LaraTraining, RunningOnceMoreGivesTheSameBits) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  PassOptions options = whole_loss(golden);
  const auto kept = gradients(ctx(), golden, options);
  EXPECT_EQ(gradients(ctx(), golden, options), kept);
  options.recompute = true;
  EXPECT_EQ(gradients(ctx(), golden, options), kept);
}

Checkpoint start_of(const LaraGolden& golden) {
  Checkpoint out;
  out.config.model = golden.config();
  out.config.schedule = {2e-3, 0, 24, 1.0, 0.1, 9};
  out.config.inputs_min = out.config.inputs_max = golden.config().views;
  out.config.fine_after = 4;
  out.config.surface_after = 2;
  out.config.distortion_weight = 10;
  out.config.normal_weight = 0.02;
  out.parameters = golden.weights();
  return out;
}

// The training reproduces the pictures. A checkpoint on the way suffices to continue with the same bits, also if the
// loss gets a new term in between.
TEST_P(LaraTraining, StepsLearnAndGoOn) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const TrainingViews views = views_of(golden);
  const Checkpoint start = start_of(golden);
  Trainer trainer(ctx(), start, 16);
  std::vector<double> psnr;
  std::vector<Checkpoint> at;
  for (int i = 0; i < 24; ++i) {
    const StepReport report = trainer.step({{&views, views.background}});
    psnr.push_back(report.psnr_coarse);
    if (i < 4) {
      EXPECT_EQ(report.psnr, report.psnr_coarse) << "one level";
    }
    EXPECT_GT(report.most_selected, 0);
    EXPECT_LE(report.selected, 1);
    if (i == 1 || i == 3 || i == 5) at.push_back(trainer.checkpoint());
  }
  EXPECT_GT(psnr.back(), psnr.front() + 1);
  const Checkpoint last = at.back();
  for (std::size_t c = 0; c + 1 < at.size(); ++c) {
    Trainer resumed(ctx(), at[c]);
    while (resumed.step() < last.step) resumed.step({{&views, views.background}});
    const Checkpoint got = resumed.checkpoint();
    for (const Parameter& p : parameters(last.config.model))
      EXPECT_EQ(got.parameters.of(p).data, last.parameters.of(p).data) << p.name << " from step " << at[c].step;
  }
}

TEST_P(LaraTraining, PlansWhatItTakes) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const TrainingViews views = views_of(golden);
  const auto fresh = test::open_context(GetParam());
  Checkpoint start = start_of(golden);
  start.config.fine_after = start.config.surface_after = 0;
  start.config.novel = static_cast<long>(golden.novel().size());
  const long all = start.config.model.selectable();
  Trainer trainer(*fresh, start, all);
  const Trainer::Plan plan = trainer.plan(all, {}), bound = trainer.bound();
  EXPECT_TRUE(plan.fits);
  EXPECT_LE(plan.peak, bound.peak);
  trainer.step({{&views, views.background}});
  EXPECT_LE(fresh->memory().peak(), bound.peak + (1 << 20));
}

}  // namespace
}  // namespace vsplat

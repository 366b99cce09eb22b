// Training with noisy poses and predicted rays.
#include <gtest/gtest.h>

#include "model/base/pose_noise.h"
#include "model/networks/params/init.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "model/train/trainer.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"

namespace vsplat {
namespace {

using test::Golden;

// Two input views and two others of an object.
TrainingViews tiny_set() {
  const Golden golden = Golden::load("micro");
  TrainingViews out;
  out.object = "golden";
  out.pictures = golden.floats("input.images");
  out.cameras = test::golden_all_cameras(golden);
  out.inputs = golden.views();
  return out;
}

Checkpoint start_of(double pose_noise, const std::string& poses = "predicted") {
  Checkpoint out;
  out.config.model = with_fields(
      named_config("micro"), {"patch=4", "poses=" + poses, "share_dim=16", "share_reduce=16,16", "share_match_layers=2",
                              "share_match_mlp=2", "share_ray_dim=32", "share_ray_layers=2", "share_ray_heads=2"});
  out.config.inputs_min = out.config.inputs_max = 2;
  out.config.schedule = {4e-3, 5, 80, 1.0, 0.1, 80};
  out.config.pose_noise = pose_noise;
  out.parameters = initial_weights(out.config.model, 3);
  return out;
}

class NoisyPoses : public test::FlavourTest {
 protected:
  // Errors of the network's current predictions, relative to the accurate cameras' rays.
  RayErrors errors(const Checkpoint& at, const TrainingViews& views) {
    const Config& config = *at.config.model.as<Config>();
    const VsplatModel model(ctx(), config, at.parameters);
    const long s = config.image;
    const std::vector<Camera> inputs(views.cameras.begin(), views.cameras.begin() + views.inputs);
    const ForwardResult result = model.forward(ctx(), ctx().upload({views.inputs, s, s, 3}, views.pictures.data()),
                                               upload_cameras(ctx(), inputs), {});
    return ray_errors(ctx().read<float>(result.rays), patch_rays(inputs, config.tokens(), config.patch));
  }
};
VSPLAT_FLAVOURS(NoisyPoses);

TEST_P(NoisyPoses, RaysAreLearnt) {
  const TrainingViews views = tiny_set();
  const Checkpoint start = start_of(0.02);
  Trainer trainer(ctx(), start);
  double first = 0, last = 0;
  for (long step = 0; step < start.config.schedule.steps; ++step) {
    last = trainer.step({{&views, views.background}}).loss;
    if (step == 0) first = last;
  }
  EXPECT_LT(last, 0.7 * first);
  const RayErrors before = errors(start, views), after = errors(trainer.checkpoint(), views);
  EXPECT_LT(after.degrees, before.degrees / 3);
  EXPECT_LT(after.moment, before.moment / 2);
}

TEST_P(NoisyPoses, NoiseFollowsFromTheSeedAndTheStep) {
  const TrainingViews views = tiny_set();
  const auto losses = [&](double sigma, const std::string& poses, std::uint64_t seed) {
    Checkpoint start = start_of(sigma, poses);
    start.config.seed = seed;
    start.config.schedule.lr = 1e-9;  // the weights hardly change
    const std::vector<float> still(static_cast<std::size_t>(start.config.model.noise()), 0.0f);
    Trainer trainer(ctx(), start);
    std::vector<double> out;
    for (int i = 0; i < 2; ++i) out.push_back(trainer.step({{&views, views.background, &still}}).loss);
    return out;
  };
  for (const char* poses : {"given", "predicted"}) {
    const auto noisy = losses(0.05, poses, 1);
    EXPECT_EQ(losses(0.05, poses, 1), noisy) << poses;
    EXPECT_NE(losses(0.05, poses, 2)[0], noisy[0]) << poses;
    EXPECT_NE(losses(0, poses, 1)[0], noisy[0]) << poses;
    EXPECT_EQ(losses(0, poses, 1)[0], losses(0, poses, 2)[0]) << poses;
  }
}

// If memory is short, the predictor is also recomputed: the same bits.
TEST_P(NoisyPoses, RunningOnceMoreGivesTheSameGradients) {
  const TrainingViews views = tiny_set();
  const AnyConfig config = start_of(0).config.model;
  const LearntWeights learnt(ctx(), parameters(config), start_of(0).parameters);
  const auto network = make_network(ctx(), config, learnt);
  PassViews pass;
  const long s = config.image();
  pass.inputs = ctx().upload({views.inputs, s, s, 3}, views.pictures.data());
  pass.cameras = views.cameras;
  pass.given = noisy_cameras({views.cameras.begin(), views.cameras.begin() + views.inputs}, 0.05, 1, 0, "golden");
  for (std::size_t v = 0; v < views.cameras.size(); ++v) {
    pass.targets.push_back(ctx().upload({1, s, s, 3}, views.pictures.data() + v * static_cast<std::size_t>(s * s * 3)));
    pass.backgrounds.push_back(views.background);
  }
  std::vector<std::vector<float>> runs;
  for (const bool recompute : {false, true}) {
    learnt.zero_gradients(ctx());
    PassOptions options;
    options.recompute = recompute;
    training_pass(ctx(), *network, pass, options);
    std::vector<float>& all = runs.emplace_back();
    for (const std::string& name : learnt.names())
      if (const Tensor& gradient = learnt.at(name).gradient) {
        const auto values = ctx().read<float>(gradient);
        all.insert(all.end(), values.begin(), values.end());
      }
  }
  EXPECT_EQ(runs[0], runs[1]);
}

}  // namespace
}  // namespace vsplat

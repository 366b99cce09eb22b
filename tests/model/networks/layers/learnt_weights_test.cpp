#include "model/networks/layers/learnt_weights.h"

#include <gtest/gtest.h>

#include "model/networks/params/init.h"
#include "model/networks/params/params.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

class Learnt : public test::FlavourTest {
 protected:
  // The Gaussians of the committed case.
  std::vector<float> run(const test::Golden& golden, const WeightSource& weights) {
    const VsplatModel model(ctx(), golden.config(), weights);
    const long edge = golden.config().image, views = golden.views();
    std::vector<float> images = golden.floats("input.images");
    images.resize(static_cast<std::size_t>(views * edge * edge * 3));
    const ForwardResult result = model.forward(ctx(), ctx().upload({views, edge, edge, 3}, images),
                                               upload_cameras(ctx(), test::golden_cameras(golden)), {});
    std::vector<float> out;
    for (const Tensor& t : {result.final.means, result.final.scales, result.final.sh, result.final.opacities})
      for (const float v : ctx().read<float>(t)) out.push_back(v);
    return out;
  }
};
VSPLAT_FLAVOURS(Learnt);

// Packed on the device or on the host: the same bits.
TEST_P(Learnt, WeightsOnTheDeviceGiveWhatThoseOfTheHostGive) {
  const test::Golden golden = test::Golden::load("micro");
  const LearntWeights learnt(ctx(), golden.config(), golden.weights());
  const std::vector<float> want = run(golden, golden.weights());
  EXPECT_GT(want.size(), 100U);
  EXPECT_EQ(run(golden, learnt), want);
}

TEST_P(Learnt, TheyComeBackAsTheyWere) {
  const Config config = named_config("micro");
  const Weights before = initial_weights(config, 3);
  const LearntWeights learnt(ctx(), config, before);
  const Weights after = learnt.download(ctx());
  ASSERT_EQ(after.all().size(), before.all().size());
  for (const auto& [name, t] : before.all()) {
    EXPECT_EQ(after.at(name).data, t.data) << name;
    EXPECT_EQ(after.at(name).shape, t.shape) << name;
  }
}

TEST_P(Learnt, GradientsAreThereForWhatIsLearntAndBecomeZero) {
  const Config config = named_config("micro");
  const LearntWeights learnt(ctx(), config, initial_weights(config, 3));
  const std::string name = "encoder.model.norm.weight";
  const Tensor gradient = learnt.at(name).gradient;
  const std::vector<float> ones(static_cast<std::size_t>(gradient.count()), 1.0f);
  EXPECT_EQ(ctx().read<float>(gradient), std::vector<float>(ones.size(), 0.0f));
  ctx().write(gradient, ones.data());
  learnt.zero_gradients(ctx());
  EXPECT_EQ(ctx().read<float>(gradient), std::vector<float>(ones.size(), 0.0f));
  EXPECT_FALSE(learnt.at("div_offset").gradient);
  for (const Parameter& p : parameters(config)) EXPECT_EQ(static_cast<bool>(learnt.at(p.name).gradient), p.trained);
}

TEST_P(Learnt, WhatIsMissingOrMisshapenIsNamed) {
  const Config config = named_config("micro");
  const auto message = [&](const Weights& weights) {
    return test::refusal([&] { const LearntWeights learnt(ctx(), config, weights); }, Status::format);
  };
  Weights weights = initial_weights(config, 3);
  weights.set("encoder.model.norm.bias", {{5}, std::vector<float>(5)});
  EXPECT_NE(message(weights).find("encoder.model.norm.bias is [5]"), std::string::npos) << message(weights);
  EXPECT_NE(message({}).find("div_offset"), std::string::npos) << message({});
}

TEST(UsedParameters, DependOnLevelsAndSelection) {
  Config config = named_config("micro");
  const auto unused = [&] {
    std::string out;
    for (const Parameter& p : parameters(config))
      if (p.trained && !p.used && p.name.find(".0.bias") != std::string::npos) out += p.name + " ";
    return out;
  };
  EXPECT_EQ(unused(), "");
  config.selection = "opacity";
  EXPECT_EQ(unused(), "predictor.act_predictor.0.bias ");
  config.levels = "skeletal";
  EXPECT_EQ(unused(),
            "predictor.act_predictor.0.bias predictor.fine_predictor.0.bias predictor.update_predictor.0.bias ");
  config.selection = "gumbel";
  EXPECT_EQ(unused(), "predictor.fine_predictor.0.bias predictor.update_predictor.0.bias ");
  config.levels = "coarse";
  for (const Parameter& p : parameters(config)) {
    const bool fine = p.name.starts_with("voxel_network.") || p.name.starts_with("predictor.fine_predictor.") ||
                      p.name.starts_with("predictor.update_predictor.");
    EXPECT_EQ(p.used, !fine && !p.name.starts_with("predictor.act_predictor.")) << p.name;
  }
}

}  // namespace
}  // namespace vsplat

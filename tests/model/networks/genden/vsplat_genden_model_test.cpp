// VS-Splat's network with the densifier, every stage of it and every gradient, against the specification's vectors.
#include "model/networks/genden/vsplat_genden_model.h"

#include <gtest/gtest.h>

#include "model/networks/params/init.h"
#include "model/networks/params/params.h"
#include "tests/support/compare.h"
#include "tests/support/lara_golden.h"
#include "tests/support/network_vectors.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::cotangents;
using test::upload;
using test::VsplatGendenGolden;

constexpr const char* kTiny = "vsplat+genden_tiny";
const std::vector<std::string> kTinySlow = {"vsplat+genden_tiny_seed1", "vsplat+genden_tiny_seed2"};

VsplatGendenOptions options_of(const VsplatGendenGolden& golden) {
  VsplatGendenOptions out;
  out.seed = std::stoull(golden.file().metadata().at("seed"));
  return out;
}

class VsplatGenden : public test::FlavourTest {};
VSPLAT_FLAVOURS(VsplatGenden);

class VsplatGendenVectors : public test::VectorsTest {};
VSPLAT_VECTORS(VsplatGendenVectors, {kTiny});
VSPLAT_SLOW_VECTORS(VsplatGendenVectors, kTinySlow);

TEST_P(VsplatGendenVectors, EveryStageMatches) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const VsplatGendenGolden golden = VsplatGendenGolden::load(name());
  const VsplatGendenModel model(ctx(), golden.config(), golden.weights());
  VsplatGendenOptions options = options_of(golden);
  test::StageOutputs stages;
  options.backbone.tap = stages.tap(ctx());
  const VsplatGendenResult result =
      model.forward(ctx(), upload(ctx(), golden, "input.images"), golden.cameras(), options);
  EXPECT_EQ(result.final.means.dim(0) * 3, static_cast<long>(golden.floats("stage.final.means").size()));
  int levels = 0;
  for (const auto& [stage, values] : stages.values) {
    ASSERT_TRUE(golden.has("stage." + stage)) << stage;
    const auto want = golden.floats("stage." + stage);
    if (stage == "score" || stage == "pull")
      EXPECT_TRUE(test::close(values, want, 1e-4)) << stage;
    else
      EXPECT_TRUE(test::close_by_channel(values, want, stages.channels.at(stage), 1e-4)) << stage;
    levels += stage.starts_with("level.");
  }
  for (const char* stage : {"refined", "base.means", "score", "selected.feature", "final.sh"})
    EXPECT_EQ(stages.values.count(stage), 1U) << stage;
  EXPECT_EQ(levels, 21);
}

TEST_P(VsplatGendenVectors, EveryGradientMatches) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const VsplatGendenGolden golden = VsplatGendenGolden::load(name());
  for (const bool recompute : {false, true}) {
    for (const bool coarse : {true, false}) {
      const LearntWeights learnt(ctx(), parameters(golden.config()), golden.weights());
      const VsplatGendenModel model(ctx(), golden.config(), learnt);
      VsplatGendenModel::Trained trained = model.forward_in_training(ctx(), upload(ctx(), golden, "input.images"),
                                                                     golden.cameras(), options_of(golden), recompute);
      if (coarse)
        model.backward(ctx(), trained, cotangents(ctx(), golden, "coarse"), {});
      else
        model.backward(ctx(), trained,
                       zero_gradients(ctx(), trained.backbone.coarse.count(), golden.config().sh_degree),
                       cotangents(ctx(), golden, "final"));
      const std::string prefix = coarse ? "cograd.coarse." : "cograd.final.";
      int compared = 0;
      for (const std::string& weight : learnt.names()) {
        if (!learnt.at(weight).gradient) continue;
        const auto got = ctx().read<float>(learnt.at(weight).gradient);
        if (!golden.has(prefix + weight)) {
          EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f)) << prefix << weight << " has none";
          continue;
        }
        EXPECT_TRUE(test::close(got, golden.floats(prefix + weight), 1e-4, true)) << prefix << weight;
        ++compared;
      }
      EXPECT_GT(compared, coarse ? 40 : 100) << prefix;
    }
  }
}

// Without candidates nothing is densified, and no gradient reaches the densifier.
TEST_P(VsplatGenden, NoCandidates) {
  VSPLAT_NEED_LARA_GOLDEN(kTiny);
  const VsplatGendenGolden golden = VsplatGendenGolden::load(kTiny);
  VsplatGendenConfig config = golden.config();
  config.densify.opacity_threshold = 0.99999;
  const LearntWeights learnt(ctx(), parameters(config), golden.weights());
  const VsplatGendenModel model(ctx(), config, learnt);
  const Tensor images = upload(ctx(), golden, "input.images");
  EXPECT_EQ(model.forward(ctx(), images, golden.cameras(), {}).final.count(), 0);
  VsplatGendenModel::Trained trained = model.forward_in_training(ctx(), images, golden.cameras(), {}, false);
  model.backward(ctx(), trained, zero_gradients(ctx(), trained.backbone.coarse.count(), config.sh_degree),
                 zero_gradients(ctx(), 0, config.sh_degree));
  const auto got = ctx().read<float>(learnt.at("dec.0.up.skip.weight").gradient);
  EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f));
}

TEST_P(VsplatGenden, PlanNamesTheDensifier) {
  const VsplatGendenConfig config = named_vsplat_genden_config("tiny");
  const auto ctx = test::open_context(GetParam());
  const Weights none = initial_weights(config, 1);
  const MemoryPlan plan = VsplatGendenModel::plan(*ctx, config, none, 3, 100);
  EXPECT_EQ(ctx->memory().reserved(), 0U) << "a plan allocates nothing";
  bool named = false;
  for (const StageMemory& stage : plan.stages) named = named || stage.stage == "densify";
  EXPECT_TRUE(named);
  EXPECT_EQ(plan.selected, 100);
}

}  // namespace
}  // namespace vsplat

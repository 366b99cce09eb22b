// The ray predictor alone: every stage and every gradient, against the PyTorch specification's vectors.
#include "model/networks/vsplat/ray_predictor.h"

#include <gtest/gtest.h>

#include "model/networks/params/init.h"
#include "model/networks/params/params.h"
#include "model/networks/vsplat/ray_tables.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/extension_golden.h"
#include "tests/support/refusal.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::ExtensionGolden;

std::vector<std::string> predictor_vectors(const std::vector<std::string>& sizes) {
  std::vector<std::string> out;
  for (const std::string& size : sizes)
    for (const char* part : {"_predictor", "_pair", "_aligned"}) out.push_back("share_" + size + part);
  return out;
}
class RayPredictorVectors : public test::VectorsTest {};
VSPLAT_VECTORS(RayPredictorVectors, predictor_vectors({"micro", "tiny"}));
VSPLAT_SLOW_VECTORS(RayPredictorVectors, predictor_vectors({"tiny_seed1", "tiny_seed2"}));

// Features after a class token, on which no result may depend.
std::vector<float> with_class_token(const HostTensor& features, float value) {
  const long v = features.shape[0], patches = features.shape[1] * features.shape[2], c = features.shape[3];
  std::vector<float> out;
  for (long view = 0; view < v; ++view) {
    out.insert(out.end(), static_cast<std::size_t>(c), value);
    const auto first = features.data.begin() + view * patches * c;
    out.insert(out.end(), first, first + patches * c);
  }
  return out;
}

TEST_P(RayPredictorVectors, EveryStageAndGradientMatches) {
  VSPLAT_NEED_GOLDEN(name());
  const ExtensionGolden golden(name(), "share.", false);
  const LearntWeights learnt(ctx(), golden.parameters(), golden.weights());
  const RayPredictor predictor(ctx(), golden.config(), learnt);
  const HostTensor features = golden.tensor("input.features");
  const long v = features.shape[0], tokens = 1 + features.shape[1] * features.shape[2], c = features.shape[3];
  const Tensor x = ctx().upload({v, tokens, c}, with_class_token(features, 7));
  int compared = 0;
  const auto tap = [&](const std::string& stage, const Tensor& t) {
    ASSERT_TRUE(golden.has("stage." + stage)) << stage;
    EXPECT_TRUE(test::close(ctx().read<float>(t), golden.floats("stage." + stage), 1e-4)) << stage;
    ++compared;
  };
  RayPredictor::Saved saved;
  const Tensor rays = predictor.forward(ctx(), x, &saved, tap);
  const Config& config = golden.config();
  EXPECT_EQ(compared, 4 + 2 * config.share_match_layers + config.share_ray_layers);
  const RayPredictor plain(ctx(), config, golden.weights());
  plain.forward(ctx(), x, nullptr, tap);

  const Tensor dtokens = ctx().tensor(x.shape());
  const auto run = [&] {
    learnt.zero_gradients(ctx());
    ctx().fill_zero(dtokens);
    predictor.backward(ctx(), saved, golden.upload(ctx(), "cotangent.plucker"), dtokens);
  };
  run();
  std::map<std::string, std::vector<float>> first;
  for (const auto& [weight, stored] : golden.names()) {
    first[weight] = ctx().read<float>(learnt.at(weight).gradient);
    EXPECT_TRUE(test::close(first[weight], golden.floats("cograd." + stored), 1e-4)) << weight;
  }
  EXPECT_TRUE(test::close(ctx().read<float>(dtokens), with_class_token(golden.tensor("cograd.features"), 0), 1e-4));
  run();
  for (const auto& [weight, values] : first) EXPECT_EQ(ctx().read<float>(learnt.at(weight).gradient), values) << weight;
}

class RayPredictorTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(RayPredictorTest);

TEST_P(RayPredictorTest, DetachedNothingGoesBack) {
  const ExtensionGolden golden("share_micro_predictor", "share.", false);
  Config config = golden.config();
  config.share_detach = true;
  const LearntWeights learnt(ctx(), golden.parameters(), golden.weights());
  const RayPredictor predictor(ctx(), config, learnt);
  const HostTensor features = golden.tensor("input.features");
  const Tensor x = ctx().upload({features.shape[0], 1 + features.shape[1] * features.shape[2], features.shape[3]},
                                with_class_token(features, 0));
  RayPredictor::Saved saved;
  predictor.forward(ctx(), x, &saved);
  const Tensor dtokens = ctx().tensor(x.shape());
  ctx().fill_zero(dtokens);
  predictor.backward(ctx(), saved, golden.upload(ctx(), "cotangent.plucker"), dtokens);
  const auto got = ctx().read<float>(dtokens);
  EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f));
  EXPECT_TRUE(test::close(ctx().read<float>(learnt.at("share.reduce.2.weight").gradient),
                          golden.floats("cograd.share.reduce.2.weight"), 1e-4));
}

TEST_P(RayPredictorTest, RefusesViewsThatItHasNoCodesFor) {
  const Config config = with_fields(named_config("micro"), {"poses=predicted", "share_ray_layers=1"});
  const RayPredictor predictor(ctx(), config, initial_weights(config, 1));
  for (const long views : {1L, 5L}) {
    const Tensor x = ctx().tensor({views, 5, config.vit_dim});
    const std::string text = test::refusal([&] { predictor.forward(ctx(), x); }, Status::usage);
    EXPECT_NE(text.find("2 to share_max_views = 4"), std::string::npos) << text;
  }
}

// Each token is in one window. Tokens are masked from each other if they are at least a window's width apart in the
// picture.
TEST(TokenWindows, AreAsRolledAndCut) {
  for (const auto& [t, splits] : {std::pair{6L, 2L}, {4L, 1L}, {9L, 3L}, {2L, 2L}, {8L, 2L}})
    for (const bool shifted : {false, true}) {
      const TokenWindows windows = token_windows(t, splits, shifted);
      const long window = t / splits, shift = shifted && splits > 1 ? window / 2 : 0;
      ASSERT_EQ(windows.tokens.size(), static_cast<std::size_t>(t * t));
      for (long w = 0; w < windows.count; ++w)
        for (long i = 0; i < windows.length; ++i) {
          const auto at = static_cast<std::size_t>(w * windows.length);
          const long token = windows.tokens[at + static_cast<std::size_t>(i)];
          const long row = (token / t + t - shift) % t, column = (token % t + t - shift) % t;
          EXPECT_EQ(row / window * splits + column / window, w);
          EXPECT_EQ(row % window * window + column % window, i);
          for (long j = 0; j < windows.length; ++j) {
            const long other = windows.tokens[at + static_cast<std::size_t>(j)];
            const bool far = std::abs(token / t - other / t) >= window || std::abs(token % t - other % t) >= window;
            EXPECT_EQ(
                windows.parts[at + static_cast<std::size_t>(i)] != windows.parts[at + static_cast<std::size_t>(j)],
                far);
          }
        }
    }
}

}  // namespace
}  // namespace vsplat

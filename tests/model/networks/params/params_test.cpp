#include "model/networks/params/params.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <set>

#include "tests/support/golden.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::Golden;

// Names, shapes and order against the state dict that a golden file holds.
void expect_state_dict(const Golden& golden) {
  constexpr std::string_view kPrefix = "weight.";
  std::vector<std::pair<std::string, Shape>> expected, found;
  for (const TensorEntry& entry : golden.file().tensors())
    if (entry.name.starts_with(kPrefix)) expected.emplace_back(entry.name.substr(kPrefix.size()), entry.shape);
  for (const Parameter& p : parameters(golden.config())) found.emplace_back(p.name, p.shape);
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(found, expected);
}

TEST(Params, AreTheReferencesStateDict) {
  expect_state_dict(Golden::load("micro"));
  expect_state_dict(Golden::load("micro_noise"));
}

TEST(Params, OfExtensionsAreTheReferencesStateDict) {
  for (const std::string& name : test::extension_cases()) {
    VSPLAT_NEED_GOLDEN(name);
    expect_state_dict(Golden::load(name));
  }
}

// The encoder of DINOv3's ViT-B/16, and the predictor in SHARE's configuration for objects.
TEST(Params, OfPublishedExtensions) {
  const Config config = with_fields(named_config("paper"), {"encoder=dinov3", "poses=predicted"});
  std::map<std::string, Shape> shapes;
  long encoder = 0, predictor = 0;
  for (const Parameter& p : parameters(config)) {
    shapes[p.name] = p.shape;
    if (p.name.starts_with("encoder.")) encoder += p.count();
    if (p.name.starts_with("share.")) predictor += p.count();
  }
  EXPECT_EQ(encoder, 85641216);
  EXPECT_EQ(predictor, 10083110);
  EXPECT_EQ(shapes.at("encoder.model.reg_token"), (Shape{1, 4, 768}));
  EXPECT_EQ(shapes.at("encoder.model.blocks.11.gamma_2"), (Shape{768}));
  EXPECT_EQ(shapes.at("share.view_pos_emb"), (Shape{4, 8}));
  EXPECT_EQ(shapes.at("share.transformer.layers.5.cross_attn_ffn.mlp.0.weight"), (Shape{1024, 256}));
  EXPECT_EQ(shapes.at("share.ray_predictor.x_embedder.proj.weight"), (Shape{256, 136, 1, 1}));
  EXPECT_EQ(shapes.count("encoder.model.pos_embed"), 0U);
}

class ParamsOfTiny : public ::testing::TestWithParam<std::string> {};

TEST_P(ParamsOfTiny, AreTheReferencesStateDict) {
  VSPLAT_NEED_GOLDEN(GetParam());
  expect_state_dict(Golden::load(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(Golden, ParamsOfTiny, ::testing::ValuesIn(test::golden_cases()),
                         [](const auto& one) { return one.param; });

TEST(GoldenCases, AreThoseOfTheScript) {
  // A name that the script does not make would always be skipped.
  const std::string script = test::contents_of(std::filesystem::path(Golden::path_of("micro")).parent_path().string() +
                                               "/../reference/pytorch/make_cases.py");
  const std::size_t begin = script.find("TINY = {");
  ASSERT_NE(begin, std::string::npos);
  const std::string table = script.substr(begin, script.find("\n}", begin) - begin);
  const std::string key = "\n    \"";  // only the lines of its table begin like this
  std::set<std::string> made;
  for (std::size_t at = table.find(key); at != std::string::npos; at = table.find(key, at + 1)) {
    const std::size_t name = at + key.size();
    made.insert(table.substr(name, table.find('"', name) - name));
  }
  EXPECT_EQ(made, std::set<std::string>(test::golden_cases().begin(), test::golden_cases().end()));
}

TEST(Params, CountsAreTheReferences) {
  EXPECT_EQ(parameter_count(named_config("micro")), 38551);
  EXPECT_EQ(parameter_count(named_config("tiny")), 532466);
  EXPECT_EQ(parameter_count(named_config("small")), 16175773);
  EXPECT_EQ(parameter_count(named_config("paper")), 128419093);
}

TEST(Params, NamesAreDistinctAndGradientsCoverThem) {
  // The golden file has a gradient for every trained parameter of the reference, and for nothing else.
  const Golden golden = Golden::load("micro");
  std::set<std::string> names;
  for (const Parameter& p : parameters(golden.config())) {
    EXPECT_TRUE(names.insert(p.name).second) << p.name;
    EXPECT_EQ(golden.has("grad." + p.name), p.trained) << p.name;
    EXPECT_EQ(p.name == "div_offset", !p.trained);
  }
}

TEST(Params, AllButBiasesAndLayerNormsDecay) {
  for (const Parameter& p : parameters(named_config("paper"))) {
    const bool layer_norms = p.name.starts_with("encoder.") || p.name.starts_with("dir_norm.");
    const bool norm = p.name.find("norm.") != std::string::npos || p.name.find("norm1.") != std::string::npos ||
                      p.name.find("norm2.") != std::string::npos;
    const bool of_layer_norm = layer_norms && norm && !p.name.starts_with("dir_norm.mlp.");
    EXPECT_EQ(p.decays, !p.name.ends_with(".bias") && !of_layer_norm) << p.name;
  }
}

TEST(Params, FanInIsWhatFeedsOneOutput) {
  for (const Parameter& p : parameters(named_config("paper"))) {
    if (p.init == Init::zeros || p.init == Init::ones || p.init == Init::position || p.init == Init::sobol) continue;
    ASSERT_GT(p.fan_in, 0) << p.name;
    if (p.shape.size() > 1) {
      EXPECT_EQ(p.fan_in, p.count() / p.shape[0]) << p.name;
    }
    if (p.init == Init::xavier) {
      EXPECT_EQ(p.fan_out, p.shape[0]) << p.name;
    }
  }
}

}  // namespace
}  // namespace vsplat

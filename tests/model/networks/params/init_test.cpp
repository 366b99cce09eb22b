#include "model/networks/params/init.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "model/base/normal_quantile.h"
#include "model/networks/params/load_encoder.h"
#include "model/networks/params/model_file.h"
#include "model/networks/params/params.h"
#include "runtime/files/sha256.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

struct Moments {
  double mean = 0, variance = 0, least = INFINITY, most = -INFINITY;
};

Moments moments_of(const std::vector<float>& x) {
  Moments m;
  for (const float v : x) {
    m.mean += v / static_cast<double>(x.size());
    m.least = std::min<double>(m.least, v);
    m.most = std::max<double>(m.most, v);
  }
  for (const float v : x) m.variance += (v - m.mean) * (v - m.mean) / static_cast<double>(x.size());
  return m;
}

// Digest of all names, shapes and values.
std::string digest_of(const Weights& weights) {
  Sha256 hash;
  for (const auto& [name, tensor] : weights.all()) {
    hash.add(name.data(), name.size());
    hash.add(tensor.data.data(), tensor.data.size() * sizeof(float));
  }
  return hash.hex();
}

TEST(NormalQuantile, InvertsTheDistributionFunction) {
  for (int hundredths = -630; hundredths < 630; ++hundredths) {
    const double z = 0.01 * hundredths;
    const double lower = 0.5 * std::erfc(-z / std::sqrt(2.0));
    if (lower < 0.5) {
      // For p near 1, p itself cannot carry 1 - p to this accuracy.
      EXPECT_NEAR(normal_quantile(lower), z, 1e-13 * std::fabs(z) + 1e-15) << z;
      EXPECT_NEAR(normal_quantile(1 - lower), -z, 1e-16 / lower * std::fabs(z) + 1e-13) << z;
    }
  }
  EXPECT_EQ(normal_quantile(0.5), 0.0);
  EXPECT_NEAR(normal_quantile(1e-300), -37.0471, 1e-4);
  EXPECT_NEAR(normal_quantile(0.975), 1.959963984540054, 1e-15);
}

TEST(Sobol, IsTheUnscrambledSequenceAfterTheOrigin) {
  // torch.quasirandom.SobolEngine(3).draw(17)[1:]
  const std::vector<double> expected = {
      0.5,    0.5,    0.5,    0.75,   0.25,   0.25,   0.25,   0.75,   0.75,   0.375,   0.375,   0.625,
      0.875,  0.875,  0.125,  0.625,  0.125,  0.875,  0.125,  0.625,  0.375,  0.1875,  0.3125,  0.9375,
      0.6875, 0.8125, 0.4375, 0.9375, 0.0625, 0.6875, 0.4375, 0.5625, 0.1875, 0.3125,  0.1875,  0.3125,
      0.8125, 0.6875, 0.8125, 0.5625, 0.4375, 0.0625, 0.0625, 0.9375, 0.5625, 0.09375, 0.46875, 0.46875};
  EXPECT_EQ(sobol_points(16), expected);
  EXPECT_TRUE(sobol_points(0).empty());
}

TEST(InitialWeights, CoverTheParametersAndFollowTheirKind) {
  const Config config = named_config("small");
  const Weights weights = initial_weights(config, 3);
  ASSERT_EQ(weights.all().size(), parameters(config).size());
  for (const Parameter& p : parameters(config)) {
    const HostTensor& tensor = weights.at(p.name);
    ASSERT_EQ(tensor.shape, p.shape) << p.name;
    ASSERT_EQ(static_cast<long>(tensor.data.size()), p.count()) << p.name;
    const Moments m = moments_of(tensor.data);
    const double n = static_cast<double>(p.count()), fan_in = static_cast<double>(p.fan_in);
    // Six standard errors of the mean and of the variance; for the variance a normal's, which is the larger.
    const auto expect = [&](double variance) {
      EXPECT_NEAR(m.mean, 0, 6 * std::sqrt(variance / n)) << p.name;
      EXPECT_NEAR(m.variance, variance, 6 * variance * std::sqrt(2 / n)) << p.name;
    };
    const bool is_head = p.name.starts_with("predictor."), is_bias = p.name.ends_with(".bias");
    switch (p.init) {
      case Init::fan_in:
        expect(1 / fan_in / 3);
        EXPECT_LE(std::max(m.most, -m.least), 1 / std::sqrt(fan_in));
        if (n > 1000) {
          EXPECT_GT(std::min(m.most, -m.least), 0.98 / std::sqrt(fan_in)) << p.name;
        }
        EXPECT_FALSE(is_head) << p.name;
        break;
      case Init::xavier:
        expect(2.0 / static_cast<double>(p.shape[0] + p.shape[1]));
        EXPECT_TRUE(is_head && !is_bias) << p.name;
        break;
      case Init::submanifold:
        expect(1 / fan_in);
        EXPECT_GT(m.most * std::sqrt(fan_in), 3)
            << p.name;  // the tail of a normal distribution, which a uniform one lacks
        EXPECT_TRUE(p.name.starts_with("voxel_network.") && p.shape.size() == 5) << p.name;
        break;
      case Init::normal:
        ADD_FAILURE() << p.name << ": LaRa's alone";
        break;
      case Init::position:
        expect(0.02 * 0.02);
        EXPECT_EQ(p.name, "encoder.model.pos_embed");
        break;
      case Init::zeros:
        EXPECT_TRUE(m.least == 0 && m.most == 0) << p.name;
        break;
      case Init::ones:
        EXPECT_TRUE(m.least == 1 && m.most == 1 && p.shape.size() == 1) << p.name;
        break;
      case Init::layer_scale:
        ADD_FAILURE() << p.name << ": DINOv3's alone";
        break;
      case Init::sobol:
        EXPECT_EQ(p.name, "div_offset");
        EXPECT_EQ(tensor.data[0], 0.0f);
        EXPECT_EQ(tensor.data[3], 0.5f / 32 / 4);
        EXPECT_EQ(tensor.data[4], -0.5f / 32 / 4);
        break;
    }
  }
}

// DINOv3's encoder and the ray predictor.
TEST(InitialWeights, OfExtensionsFollowTheirKind) {
  const Config config =
      with_fields(named_config("small"), {"encoder=dinov3", "vit_qkv_bias=true", "poses=predicted", "share_dim=64"});
  const Weights weights = initial_weights(config, 3);
  const auto moments = [&](const std::string& name) { return moments_of(weights.at(name).data); };
  const std::string block = "encoder.model.blocks.1.";
  EXPECT_EQ(moments(block + "gamma_2").least, 1e-5f);
  EXPECT_EQ(moments(block + "gamma_2").most, 1e-5f);
  EXPECT_EQ(moments(block + "attn.q_bias").most, 0);
  EXPECT_NEAR(moments("encoder.model.reg_token").variance, 0.02 * 0.02, 1e-4);
  EXPECT_NEAR(moments("share.view_pos_emb").variance, 1, 1);
  EXPECT_GT(moments("share.view_pos_emb").most, 1);
  // Xavier's initialisation in the transformers and the head; elsewhere that of convolutions.
  EXPECT_NEAR(moments("share.transformer.layers.0.self_attn.q_proj.weight").variance, 2.0 / (64 + 64), 2e-3);
  EXPECT_NEAR(moments("share.ray_predictor.blocks.3.mlp.fc1.weight").variance, 2.0 / (256 + 1024), 1e-4);
  EXPECT_EQ(moments("share.ray_predictor.blocks.3.mlp.fc1.bias").most, 0);
  EXPECT_LE(moments("share.reduce.2.weight").most, 1 / std::sqrt(384.0));
  EXPECT_GT(moments("share.reduce.2.bias").most, 0.9 / std::sqrt(384.0));
  for (const Parameter& p : parameters(config)) {
    const bool bias = p.name.ends_with("bias");
    const bool layer_norm = p.init == Init::ones && !p.name.starts_with("share.reduce.") &&
                            !p.name.starts_with("volume_network.") && !p.name.starts_with("voxel_network.");
    EXPECT_EQ(p.decays, !bias && !layer_norm) << p.name;
  }
}

// The parts that only LaRa's network has: embeddings, attention without biases, heads.
TEST(InitialWeights, OfLaraFollowTheirKind) {
  const LaraConfig config = named_lara_config("tiny");
  const Weights weights = initial_weights(config, 3);
  ASSERT_EQ(weights.all().size(), parameters(config).size());
  const auto expect = [&](const char* name, double variance) {
    const HostTensor& tensor = weights.at(name);
    const Moments m = moments_of(tensor.data);
    const double n = static_cast<double>(tensor.data.size());
    EXPECT_NEAR(m.mean, 0, 6 * std::sqrt(variance / n)) << name;
    EXPECT_NEAR(m.variance, variance, 6 * variance * std::sqrt(2 / n)) << name;
  };
  expect("view_embed", 1.0 / 4);
  expect("vol_decoder.pos_embed", 1.0 / 16);
  expect("vol_decoder.layers.0.cross_attn.k_proj_weight", 2.0 / (16 + 28));
  expect("vol_decoder.layers.2.cnn.weight", 1.0 / (16 * 27) / 3);
  expect("vol_decoder.deconv.weight", 1.0 / (12 * 8) / 3);
  expect("decoder.mlp_coarse.0.weight", 2.0 / 24);
}

TEST(InitialWeights, ASeedGivesTheSameBytesEverywhere) {
  // Pinned values: they must not depend on machine, compiler or C library.
  EXPECT_EQ(digest_of(initial_weights(named_config("micro"), 0)),
            "f140263e82d176a654f2a3e6611b683a4b8d25ba6fdda99c72cfdff8f60b5f1a");
  EXPECT_EQ(digest_of(initial_weights(named_config("micro"), 1ull << 40)),
            "7819a2d403b4022dec8da3131c4fbde33ef1392ff744ae0a50bde9ab388e0729");
}

TEST(InitialWeights, SeedsAndTensorsDiffer) {
  const Config config = named_config("micro");
  const Weights a = initial_weights(config, 1), b = initial_weights(config, 2);
  std::set<std::pair<float, float>> starts;
  std::size_t drawn = 0;
  for (const Parameter& p : parameters(config)) {
    if (p.init == Init::zeros || p.init == Init::ones || p.init == Init::sobol) {
      EXPECT_EQ(a.at(p.name).data, b.at(p.name).data) << p.name;
      continue;
    }
    EXPECT_NE(a.at(p.name).data, b.at(p.name).data) << p.name;
    // Equal numbers under two names would mean that the tensors share a random stream, up to their scale.
    const auto& x = a.at(p.name).data;
    if (x.size() < 2) continue;
    starts.insert({x[0] / x[1], x[1]});
    ++drawn;
  }
  EXPECT_EQ(starts.size(), drawn);
}

// A model initialised from one with another number of voxels gets the fine embeddings of its own size; nothing else
// changes.
TEST(InitialWeights, PlacesAreScaledFromOneVolumeToAnother) {
  const Config coarse = named_config("micro"), fine = with_fields(coarse, {"volume=8"});
  const Weights before = initial_weights(coarse, 1), wanted = initial_weights(fine, 1);
  Weights scaled = before;
  EXPECT_EQ(scale_places(scaled, fine, 4.0 / 8.0), static_cast<std::size_t>(3 * fine.fine_count));
  EXPECT_EQ(scaled.at("div_offset").data, wanted.at("div_offset").data);
  EXPECT_NE(scaled.at("div_offset").data, before.at("div_offset").data);
  for (const auto& [name, tensor] : before.all()) {
    if (name == "div_offset") continue;
    EXPECT_EQ(scaled.at(name).data, tensor.data) << name;
  }
}

TEST(InitialWeights, OtherSizesLeaveATensorsNumbersAlone) {
  const Weights a = initial_weights(named_config("micro"), 1);
  const Weights b = initial_weights(with_fields(named_config("micro"), {"vit_depth=3", "use_projected=false"}), 1);
  EXPECT_EQ(a.at("encoder.model.norm.weight").data, b.at("encoder.model.norm.weight").data);
  EXPECT_EQ(a.at("dir_norm.mlp.2.weight").data, b.at("dir_norm.mlp.2.weight").data);
  EXPECT_EQ(a.at("encoder.model.blocks.0.attn.qkv.weight").data, b.at("encoder.model.blocks.0.attn.qkv.weight").data);
}

// ---------------------------------------------------------------------------------------------------------- an encoder

class EncoderTest : public ::testing::Test {
 protected:
  // Writes the encoder of initial weights under another prefix, with extra tensors.
  std::string write(const std::string& prefix, const Config& config, const std::map<std::string, Shape>& extra = {},
                    const std::string& without = "") {
    const Weights source = initial_weights(config, 77);
    std::vector<TensorToWrite> tensors;
    for (const auto& [name, tensor] : source.all())
      if (name.starts_with("encoder.model.") && name != "encoder.model." + without)
        tensors.push_back({prefix + name.substr(14), Dtype::f32, tensor.shape, tensor.data.data()});
    const std::vector<float> ones(1000, 1.0f);
    for (const auto& [name, shape] : extra) tensors.push_back({name, Dtype::f32, shape, ones.data()});
    const std::string path = folder_.path("vit.safetensors");
    write_safetensors(path, tensors, {{"format", "pt"}});
    return path;
  }

  std::string refusal(const std::string& path) {
    Weights weights = initial_weights(config_, 1);
    const std::string before = digest_of(weights);
    const std::string message = test::refusal([&] { load_encoder(weights, config_, path); }, Status::format);
    EXPECT_EQ(digest_of(weights), before);
    EXPECT_NE(message.find(path), std::string::npos);
    return message;
  }

  TemporaryFolder folder_;
  Config config_ = named_config("micro");
};

TEST_F(EncoderTest, TakesTheEncoderAloneUnderAnyPrefix) {
  const Weights source = initial_weights(config_, 77), fresh = initial_weights(config_, 1);
  for (const char* prefix : {"", "model.", "encoder.model.", "net.encoder.model.", "backbone.", "module."}) {
    Weights weights = fresh;
    load_encoder(
        weights, config_,
        write(prefix, config_,
              {{std::string(prefix) + "head.weight", {10, 12}}, {std::string(prefix) + "fc_norm.bias", {12}}}));
    ASSERT_EQ(weights.all().size(), fresh.all().size());
    for (const auto& [name, tensor] : weights.all())
      EXPECT_EQ(tensor.data, (name.starts_with("encoder.model.") ? source : fresh).at(name).data)
          << prefix << " " << name;
  }
}

TEST_F(EncoderTest, TakesItOutOfAModelFile) {
  const std::string path = folder_.path("model.safetensors");
  const Weights source = initial_weights(config_, 5);
  save_model(path, config_, source);
  Weights weights = initial_weights(config_, 1);
  load_encoder(weights, config_, path);
  EXPECT_EQ(weights.at("encoder.model.pos_embed").data, source.at("encoder.model.pos_embed").data);
  EXPECT_NE(weights.at("dir_norm.mlp.0.weight").data, source.at("dir_norm.mlp.0.weight").data);
}

TEST_F(EncoderTest, NamesTheFieldThatDiffers) {
  const char* cases[][2] = {{"vit_pos_grid=5", "vit_pos_grid = 5, but the configuration has 3"},
                            {"vit_dim=14", "vit_dim = 14, but the configuration has 12"},
                            {"vit_depth=2", "vit_depth = 2, but the configuration has 1"},
                            {"patch=4", "patch = 4, but the configuration has 8"}};
  for (const auto& [set, words] : cases) {
    const std::string message = refusal(write("", with_fields(config_, {set, "use_projected=false"})));
    EXPECT_NE(message.find(words), std::string::npos) << message;
  }
}

TEST_F(EncoderTest, NamesWhatIsMissingOrForeign) {
  EXPECT_NE(refusal(write("", config_, {}, "cls_token")).find("cls_token"), std::string::npos);
  EXPECT_NE(refusal(write("", config_, {}, "blocks.0.attn.proj.bias")).find("blocks.0.attn.proj.bias"),
            std::string::npos);
  EXPECT_NE(refusal(write("model.", config_, {{"model.blocks.0.ls1.gamma", {12}}})).find("blocks.0.ls1.gamma"),
            std::string::npos);
  EXPECT_NE(refusal(write("", config_, {{"reg_token", {1, 4, 12}}})).find("encoder = dinov3, but"), std::string::npos);
  EXPECT_NE(refusal(write("", config_, {{"pos_embed", {1, 7, 12}}}, "pos_embed")).find("7 positions"),
            std::string::npos);
  EXPECT_NE(refusal(write("", config_, {{"blocks.0.attn.qkv.bias", {12}}}, "blocks.0.attn.qkv.bias"))
                .find("[12], expected [36]"),
            std::string::npos);
}

}  // namespace
}  // namespace vsplat

// Files with only an encoder, including DINOv3's in timm's and Meta's naming, become models with that encoder.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "model/networks/params/import.h"
#include "model/networks/params/init.h"
#include "model/networks/params/load_encoder.h"
#include "runtime/files/safetensors.h"
#include "tests/support/extension_golden.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/weights.h"

namespace vsplat {
namespace {

using test::expect_error;
using test::ExtensionGolden;

// Files beside the vectors: "dinov3_micro", and "timm" of dinov3_micro_square.
std::string file_of(const std::string& size, const std::string& naming) {
  const std::string made = test::Golden::path_of(size + "_square");
  return made.substr(0, made.rfind('/') + 1) + size + "_" + naming + ".pth";
}

ImportOptions options_for(const Config& config) {
  ImportOptions out;
  out.fields = {"vit_heads=" + std::to_string(config.vit_heads), "groups=" + std::to_string(config.groups),
                "image=" + std::to_string(config.image),         "volume=" + std::to_string(config.volume),
                "volume_ch=" + std::to_string(config.volume_ch), "voxel_ch=" + std::to_string(config.voxel_ch)};
  return out;
}

bool left_out(const ImportedModel& model, const std::string& name) {
  return std::count(model.left_out.begin(), model.left_out.end(), name) == 1;
}

TEST(Dinov3Import, BothNamingsAreTheSameModel) {
  const ExtensionGolden golden("dinov3_micro_square", "encoder.model.");
  for (const char* naming : {"timm", "meta"}) {
    SCOPED_TRACE(naming);
    const ImportedModel got = import_model(file_of("dinov3_micro", naming), options_for(golden.config()));
    EXPECT_TRUE(got.encoder_alone);
    const ModelFile& model = std::get<ModelFile>(got.model);
    EXPECT_EQ(model.config.encoder, "dinov3");
    EXPECT_EQ(model.config.vit_registers, 2);
    EXPECT_FALSE(model.config.vit_qkv_bias);
    EXPECT_FALSE(model.config.negate_camera_centre);
    EXPECT_EQ(model.config.vit_rope_periods, "exact");
    for (const auto& [name, tensor] : golden.weights().all())
      EXPECT_EQ(model.weights.at(name).data, tensor.data) << name;
    EXPECT_EQ(model.weights.at("dir_norm.mlp.0.weight").data,
              initial_weights(model.config, 0).at("dir_norm.mlp.0.weight").data);
    const bool meta = std::string(naming) == "meta";
    EXPECT_EQ(got.left_out.empty(), !meta);
    for (const char* name :
         {"mask_token", "rope_embed.periods", "blocks.0.attn.qkv.bias", "blocks.0.attn.qkv.bias_mask"})
      EXPECT_EQ(left_out(got, name), meta) << name;

    // `init` accepts the file, too.
    const test::TemporaryFolder folder;
    save_model(folder / "model.safetensors", model.config, model.weights);
    Weights weights = initial_weights(model.config, 9);
    load_encoder(weights, model.config, file_of("dinov3_micro", naming));
    EXPECT_EQ(weights.at("encoder.model.blocks.0.gamma_1").data,
              model.weights.at("encoder.model.blocks.0.gamma_1").data);
  }
}

TEST(Dinov3Import, BiasesAndRoundedPeriods) {
  VSPLAT_NEED_GOLDEN("dinov3_tiny_bias");
  const ExtensionGolden golden("dinov3_tiny_bias", "encoder.model.");
  ImportOptions options = options_for(golden.config());
  const std::string meta = file_of("dinov3_tiny", "bias_meta"), timm = file_of("dinov3_tiny", "bias_timm");
  const ImportedModel got = import_model(meta, options);
  const ModelFile& model = std::get<ModelFile>(got.model);
  EXPECT_TRUE(model.config.vit_qkv_bias);
  EXPECT_EQ(model.config.vit_rope_periods, "bf16");
  for (const auto& [name, tensor] : golden.weights().all()) EXPECT_EQ(model.weights.at(name).data, tensor.data) << name;
  options.fields.emplace_back("vit_rope_periods=bf16");  // timm's file does not show it
  const ImportedModel other = import_model(timm, options);
  test::expect_equal(std::get<ModelFile>(other.model).weights, model.weights);
  EXPECT_EQ(std::get<ModelFile>(other.model).config, model.config);
  options.fields.emplace_back("vit_qkv_bias=false");
  expect_error(Status::usage, {"bias_meta.pth", "determine vit_qkv_bias, which is true"},
               [&] { import_model(meta, options); });
}

// In Meta's naming, with biases in the first block only.
TEST(Dinov3Import, ABlockWithoutItsBiasesIsNamed) {
  const ExtensionGolden golden("dinov3_micro_square", "encoder.model.");
  const Config config = with_fields(golden.config(), {"vit_qkv_bias=true", "vit_depth=2"});
  const long width = config.vit_dim;
  std::map<std::string, HostTensor> meta;
  for (const auto& [name, tensor] : golden.weights().all()) {
    std::string bare = name.substr(std::string("encoder.model.").size());
    if (bare == "reg_token") bare = "storage_tokens";
    const auto gamma = bare.find("gamma_");
    if (gamma != std::string::npos) bare = bare.substr(0, gamma) + "ls" + bare.substr(gamma + 6) + ".gamma";
    meta[bare] = tensor;
    if (bare.starts_with("blocks.0.")) meta["blocks.1." + bare.substr(9)] = tensor;  // the vectors' model has one block
  }
  const auto load = [&] {
    const test::TemporaryFolder folder;
    std::vector<TensorToWrite> tensors;
    for (const auto& [name, tensor] : meta) tensors.push_back({name, Dtype::f32, tensor.shape, tensor.data.data()});
    write_safetensors(folder / "meta.safetensors", tensors);
    Weights weights = initial_weights(config, 1);
    load_encoder(weights, config, folder / "meta.safetensors");
    return weights;
  };
  for (int i = 0; i < 2; ++i) {
    std::vector<float> bias(static_cast<std::size_t>(3 * width), 0.0f);
    std::fill_n(bias.begin(), width, 0.25f);
    meta["blocks." + std::to_string(i) + ".attn.qkv.bias"] = {{3 * width}, bias};
  }
  const Weights whole = load();
  EXPECT_EQ(whole.at("encoder.model.blocks.1.attn.q_bias").data,
            std::vector<float>(static_cast<std::size_t>(width), 0.25f));
  EXPECT_EQ(whole.at("encoder.model.blocks.1.attn.v_bias").data,
            std::vector<float>(static_cast<std::size_t>(width), 0.0f));
  meta.erase("blocks.1.attn.qkv.bias");
  expect_error(Status::format, {"meta.safetensors", "blocks.1.attn.qkv.bias"}, load);
}

TEST(Dinov3Import, WhatDoesNotFitIsNamed) {
  const std::string path = file_of("dinov3_micro", "meta");
  expect_error(Status::usage, {"do not determine vit_heads, groups, image, volume: give each"},
               [&] { import_model(path); });
  Config config = with_fields(named_config("micro"), {"vit_dim=16"});
  Weights weights = initial_weights(config, 1);
  const auto refused = [&](const std::string& words) {
    expect_error(Status::format, {path, words}, [&] { load_encoder(weights, config, path); });
  };
  refused("an encoder with encoder = dinov3, but the configuration has dino");
  config.encoder = "dinov3";
  refused("vit_registers = 2, but the configuration has 4");
  config.vit_registers = 2, config.vit_rope_periods = "bf16", config.vit_heads = 1;
  weights = initial_weights(config, 1);
  refused("rope_embed.periods holds other periods than 100^(4 i / 16)");
  // LaRa's network has only DINO's encoder.
  const LaraConfig lara = named_lara_config("micro");
  weights = initial_weights(lara, 1);
  expect_error(Status::format, {path, "DINOv3's encoder, which LaRa's network does not take"},
               [&] { load_encoder(weights, lara, path); });
}

}  // namespace
}  // namespace vsplat

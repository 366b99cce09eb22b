// GenDen's configuration, its parameters against the specification's list of them, and its checkpoints as models.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "model/networks/params/import.h"
#include "model/networks/params/params.h"
#include "tests/support/golden.h"
#include "tests/support/lara_golden.h"
#include "tests/support/published_parameters.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/weights.h"

namespace vsplat {
namespace {

using test::expect_equal;
using test::expect_error;
using test::GendenGolden;
using test::refusal;

TEST(GendenParams, OfThePublishedSizeAreTheSpecifications) {
  test::expect_published("genden_parameters.txt", parameters(named_genden_config("published")), 400, "133,288,702");
  EXPECT_EQ(parameter_count(named_genden_config("published")), 133288702);
  EXPECT_EQ(parameter_count(named_genden_config("published_residual")), 133288702);
}

TEST(GendenConfigs, NamedOnesAreTheSpecifications) {
  for (const std::string& name : genden_config_names()) {
    EXPECT_NO_THROW(check(named_genden_config(name))) << name;
    EXPECT_EQ(genden_config_from_json(to_json(named_genden_config(name))), named_genden_config(name)) << name;
  }
  EXPECT_EQ(named_genden_config("published"), GendenConfig());
  EXPECT_EQ(GendenGolden::load("genden_micro").config(), named_genden_config("micro"));
  EXPECT_NE(
      refusal([] { named_genden_config("paper"); }, Status::usage).find("published, published_residual, small, tiny"),
      std::string::npos);
  const nlohmann::json ours = nlohmann::json::parse(to_json(GendenConfig()));
  EXPECT_EQ(ours["densify.channels"], nlohmann::json({160, 256}));
  EXPECT_EQ(ours["densify.cell"], 1.0 / 64);
  EXPECT_EQ(ours["kind"], "gaussian");
}

TEST(GendenConfigs, TinyIsTheSpecifications) {
  VSPLAT_NEED_LARA_GOLDEN("genden_tiny");
  EXPECT_EQ(GendenGolden::load("genden_tiny").config(), named_genden_config("tiny"));
}

TEST(GendenConfigs, WhatCannotBeBuiltIsRefusedByName) {
  const auto expect = [](const std::string& assignment, const std::string& words) {
    GendenConfig c = named_genden_config("tiny");
    set_field(c, assignment);
    EXPECT_NE(refusal([&] { check(c); }, Status::usage).find(words), std::string::npos) << assignment;
  };
  expect("kind=surfel", "kind must be gaussian");
  expect("fine_features=13", "must begin with fine_features + out_ch (found 24 and 13 + 12)");
  expect("densify.heads=3", "densify.heads must have as many entries as densify.channels (found 1)");
  expect("densify.heads=5,4", "densify.channels must be multiples of densify.heads (found 24 and 5)");
  expect("densify.upscale=1,2", "densify.upscale must be at least 2");
  expect("densify.non_leaf_ratio=1", "densify.non_leaf_ratio must be in (0,1)");
  expect("densify.orders=z,spiral", "densify.orders must be one of z, z-trans, hilbert, hilbert-trans");
  expect("densify.orders=", "densify.orders must be one of");
  expect("densify.duplicates=none", "densify.duplicates must be one of spconv, all");
  expect("densify.top_k=0", "densify.top_k must be 1 to");
  expect("densify.cell=0", "densify.cell must be in [0.0001,1]");
  expect("densify.cell=0.00009", "densify.cell must be in [0.0001,1]");
  GendenConfig c = named_genden_config("tiny");
  EXPECT_NE(refusal([&] { set_field(c, "top_k=3"); }, Status::usage).find("no field \"top_k\""), std::string::npos);
}

TEST(GendenImport, ACheckpointOfANamedSizeIsItsModel) {
  const GendenGolden golden = GendenGolden::load("genden_micro");
  const ImportedModel got = import_model(GendenGolden::checkpoint_of("genden_micro"));
  EXPECT_EQ(got.named, "micro");
  EXPECT_EQ(system_of(got.model), "genden");
  const GendenModelFile& model = std::get<GendenModelFile>(got.model);
  EXPECT_EQ(model.config, golden.config());
  expect_equal(model.weights, golden.weights());
  for (const char* name : {"net.volume_grid", "net.group_centers", "net.dec.0.up.frequencies", "optimizer_states"})
    EXPECT_EQ(std::count(got.left_out.begin(), got.left_out.end(), name), 1) << name;

  const test::TemporaryFolder folder;
  save_model(folder / "genden.safetensors", model.config, model.weights, {{"origin", "a test"}});
  const AnyModel read = load_any_model(SafetensorsFile(folder / "genden.safetensors"));
  EXPECT_EQ(std::get<GendenModelFile>(read).config, model.config);
  expect_equal(std::get<GendenModelFile>(read).weights, model.weights);
  const ModelInfo info = model_info(folder / "genden.safetensors");
  EXPECT_EQ(info.system, "genden");
  EXPECT_EQ(info.parameters, parameter_count(model.config));
  expect_error(Status::format, {"genden.safetensors", "GenDen's network", "VS-Splat's network is expected"},
               [&] { load_model(folder / "genden.safetensors"); });
}

// The second published model has the same tensors in another order; the user may override what the order implies.
TEST(GendenImport, TheOrderOfItsTensorsTellsTheResidualModel) {
  VSPLAT_NEED_LARA_GOLDEN("genden_tiny_residual");
  const std::string path = GendenGolden::checkpoint_of("genden_tiny_residual");
  const ImportedModel got = import_model(path);
  EXPECT_EQ(got.named, "tiny");
  EXPECT_EQ(std::get<GendenModelFile>(got.model).config, GendenGolden::load("genden_tiny_residual").config());
  EXPECT_TRUE(std::get<GendenModelFile>(got.model).config.densify.residual);
  ImportOptions options;
  options.fields = {"densify.residual=false"};
  EXPECT_FALSE(std::get<GendenModelFile>(import_model(path, options).model).config.densify.residual);
}

TEST(GendenImport, WhatContradictsTheShapesIsRefused) {
  const std::string path = GendenGolden::checkpoint_of("genden_micro");
  ImportOptions options;
  options.fields = {"densify.frequencies=4"};
  expect_error(Status::usage, {"determine densify.frequencies, which is 3, but 4 was asked for"},
               [&] { import_model(path, options); });
  options.fields = {"densify.heads=5,2"};
  expect_error(Status::usage, {"genden_micro.ckpt", "multiples of densify.heads"},
               [&] { import_model(path, options); });
}

TEST(VsplatGendenParams, OfThePaperAndOfACheckpoint) {
  EXPECT_EQ(parameter_count(named_vsplat_genden_config("paper")), 155890328);
  for (const std::string& name : vsplat_genden_config_names()) {
    const VsplatGendenConfig config = named_vsplat_genden_config(name);
    EXPECT_NO_THROW(check(config)) << name;
    EXPECT_EQ(vsplat_genden_config_from_json(to_json(config)), config) << name;
  }
  VsplatGendenConfig c = named_vsplat_genden_config("tiny");
  set_field(c, "fine_dim=32");
  EXPECT_NE(refusal([&] { check(c); }, Status::usage).find("begin with fine_dim (found 24 and 32)"), std::string::npos);
  c = named_vsplat_genden_config("tiny");
  set_field(c, "levels=coarse");
  EXPECT_NE(refusal([&] { check(c); }, Status::usage).find("levels must be fine"), std::string::npos);

  VSPLAT_NEED_LARA_GOLDEN("vsplat+genden_tiny");
  const auto golden = test::VsplatGendenGolden::load("vsplat+genden_tiny");
  const ImportedModel got = import_model(test::VsplatGendenGolden::checkpoint_of("vsplat+genden_tiny"));
  EXPECT_EQ(got.named, "tiny");
  EXPECT_EQ(system_of(got.model), "vsplat+genden");
  VsplatGendenConfig config = std::get<VsplatGendenModelFile>(got.model).config;
  EXPECT_TRUE(config.negate_camera_centre);
  config.negate_camera_centre = golden.config().negate_camera_centre;
  EXPECT_EQ(config, golden.config());
  const test::TemporaryFolder folder;
  save_model(folder / "dense.safetensors", config, golden.weights());
  const AnyModel read = load_any_model(SafetensorsFile(folder / "dense.safetensors"));
  EXPECT_EQ(std::get<VsplatGendenModelFile>(read).config, config);
  expect_equal(std::get<VsplatGendenModelFile>(read).weights, golden.weights());
}

}  // namespace
}  // namespace vsplat

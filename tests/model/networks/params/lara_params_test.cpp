// LaRa's configuration, and its parameters against the specification's list of them.
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "model/io/archive/torch_file.h"
#include "model/networks/params/lara_config.h"
#include "model/networks/params/params.h"
#include "tests/support/golden.h"
#include "tests/support/lara_golden.h"
#include "tests/support/published_parameters.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::refusal;

TEST(LaraParams, OfThePublishedSizeAreTheSpecifications) {
  test::expect_published("lara_parameters.txt", parameters(named_lara_config("published")), 300, "125,335,880");
  EXPECT_EQ(parameter_count(named_lara_config("published")), 125335880);
}

class LaraParamsOf : public ::testing::TestWithParam<std::string> {};

TEST_P(LaraParamsOf, AreTheCheckpoints) {
  VSPLAT_NEED_LARA_GOLDEN(GetParam());
  const TorchFile file(test::LaraGolden::checkpoint_of(GetParam()));
  const LaraConfig config = test::LaraGolden::load(GetParam()).config();
  const std::set<std::string> buffers = {"net.dense_grid", "net.centers", "net.volume_grid", "net.group_centers"};
  std::set<std::string> want, got;
  for (const TensorEntry& entry : file.tensors())
    if (buffers.count(entry.name) == 0) want.insert(fmt::format("{} {}", entry.name, fmt::join(entry.shape, " x ")));
  for (const Parameter& p : parameters(config)) got.insert(test::line_of(p));
  EXPECT_EQ(got, want);
}

INSTANTIATE_TEST_SUITE_P(Golden, LaraParamsOf,
                         ::testing::Values("lara_micro", "lara_tiny", "lara_tiny_gaussian", "lara_micro_gaussian"),
                         [](const auto& one) { return one.param; });

TEST(LaraParams, EveryOneIsLearntAndBiasesAndNormsDoNotDecay) {
  for (const Parameter& p : parameters(named_lara_config("tiny"))) {
    EXPECT_TRUE(p.trained && p.used) << p.name;
    EXPECT_EQ(p.decays, p.shape.size() > 1) << p.name;
  }
}

TEST(LaraConfig, NamedOnesAreTheSpecifications) {
  for (const std::string& name : lara_config_names()) {
    EXPECT_NO_THROW(check(named_lara_config(name))) << name;
    EXPECT_EQ(lara_config_from_json(to_json(named_lara_config(name))), named_lara_config(name)) << name;
  }
  EXPECT_EQ(named_lara_config("published"), LaraConfig());
  EXPECT_EQ(test::LaraGolden::load("lara_micro").config(), named_lara_config("micro"));
  EXPECT_NE(refusal([] { named_lara_config("paper"); }, Status::usage).find("published, small, tiny, micro"),
            std::string::npos);
  // json.dumps(asdict(Config())) of the specification, which lacks `rebase`.
  const std::string text =
      R"({"image": 512, "views": 4, "patch": 16, "vit_dim": 768, "vit_depth": 12, "vit_heads": 12, "vit_pos_grid": 14,
          "feature_volume": 16, "volume": 32, "windows": [16], "volume_ch": 256, "layers": 12, "heads": 16,
          "view_slots": 4, "view_ch": 32, "out_ch": 80, "primitives": 2, "kind": "surfel", "offset_cells": 32,
          "fine_heads": 8, "fine_hidden": 64, "fine_features": 0, "sh_degree": 1, "opacity_threshold": 0.005,
          "sample_half_pixel": true, "negate_camera_centre": true, "revision": "lara"})";
  json ours = json::parse(to_json(LaraConfig()));
  EXPECT_EQ(ours["rebase"], "move");
  ours.erase("rebase");
  EXPECT_EQ(ours, json::parse(text));
}

TEST(LaraConfig, TinyIsTheSpecifications) {
  VSPLAT_NEED_LARA_GOLDEN("lara_tiny");
  EXPECT_EQ(test::LaraGolden::load("lara_tiny").config(), named_lara_config("tiny"));
}

TEST(LaraConfig, WhatCannotBeBuiltIsRefusedByName) {
  const auto expect = [](const std::string& assignment, const std::string& words) {
    LaraConfig c = named_lara_config("tiny");
    set_field(c, assignment);
    EXPECT_NE(refusal([&] { check(c); }, Status::usage).find(words), std::string::npos) << assignment;
  };
  expect("image=25", "image must be a multiple of patch (found 25 and 4)");
  expect("image=8", "image must be at least 11");
  expect("vit_heads=5", "vit_dim must be a multiple of vit_heads");
  expect("heads=3", "volume_ch must be a multiple of heads (found 16 and 3)");
  expect("fine_heads=5", "out_ch must be a multiple of fine_heads");
  expect("views=5", "views must be 1 to view_slots (found 5 and 4)");
  expect("windows=3,2", "must be multiples of every entry of windows (found 6, 3 and 2)");
  expect("windows=0", "every entry of windows");
  expect("kind=disc", "kind must be one of surfel, gaussian");
  expect("revision=old", "revision must be one of lara, current");
  expect("opacity_threshold=1", "opacity_threshold must be in [0,1)");
  expect("volume=1260", "volume must be 1 to 128");
  expect("layers=0", "layers must be 1 to 256");
  expect("sh_degree=4", "sh_degree must be 0 to 3");
  LaraConfig c = named_lara_config("tiny");
  c.volume = 126, c.out_ch = 240;
  EXPECT_NE(refusal([&] { check(c); }, Status::usage).find("(2 volume)^3 out_ch, must be at most 2147483647"),
            std::string::npos);
  EXPECT_NE(refusal([&] { set_field(c, "voxel_ch=3"); }, Status::usage).find("no field \"voxel_ch\""),
            std::string::npos);
}

}  // namespace
}  // namespace vsplat

#include "model/networks/params/config.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::refusal;

TEST(Config, NamedOnesAreValidAndDistinct) {
  for (const std::string& name : config_names()) {
    EXPECT_NO_THROW(check(named_config(name))) << name;
    EXPECT_EQ(config_from_json(to_json(named_config(name))), named_config(name)) << name;
  }
  EXPECT_EQ(named_config("paper"), Config());
  EXPECT_EQ(named_config("tiny").volume, 10);
  EXPECT_NE(refusal([] { named_config("huge"); }, Status::usage).find("paper, small, tiny, micro"), std::string::npos);
}

TEST(Config, ReadsPythonsJson) {
  // json.dumps(asdict(Config())) of the reference.
  const std::string text =
      R"({"image": 512, "views": 4, "patch": 16, "vit_dim": 768, "vit_depth": 12, "vit_heads": 12, "vit_pos_grid": 14,
          "volume": 48, "volume_ch": 128, "volume_mult": [1, 2], "voxel_ch": 256, "voxel_levels": 2, "fine_dim": 512,
          "fine_count": 16, "sh_degree": 1, "groups": 32, "levels": "fine", "selection": "gumbel",
          "opacity_threshold": 0.005, "use_projected": true, "view_weight": "depth", "refine_out_kernel": 1,
          "sample_half_pixel": true, "negate_camera_centre": false, "rebase": "rotate"})";
  EXPECT_EQ(config_from_json(text), Config());
  // Ours has the same fields and values.
  EXPECT_EQ(json::parse(to_json(Config())), json::parse(text));
}

TEST(Config, ViewsToUseAreThoseItIsTrainedWithUnlessItSays) {
  Config config;
  config.views = 3;
  EXPECT_EQ(config.views_to_use(), 3);
  EXPECT_EQ(to_json(config).find("use_views"), std::string::npos);  // older readers do not know the field
  config.use_views = 12;
  EXPECT_EQ(config.views_to_use(), 12);
  EXPECT_EQ(config_from_json(to_json(config)), config);
  for (const int wrong : {-1, 17}) {
    config.use_views = wrong;
    EXPECT_NE(refusal([&] { check(config); }, Status::usage).find("use_views"), std::string::npos);
  }
}

TEST(Config, PassesAndCellsAreThoseOfReconstructions) {
  Config config;
  for (const char* field : {"passes", "merge_cell", "fit_epochs"})
    EXPECT_EQ(to_json(config).find(field), std::string::npos) << field;
  config.passes = 4, config.merge_cell = 1.25, config.fit_epochs = 50;
  EXPECT_EQ(config_from_json(to_json(config)), config);
  EXPECT_EQ(config.taken().passes, 4);
  EXPECT_EQ(config.taken().fit_epochs, 50);
  EXPECT_EQ(config.taken().cells, config.volume);
  const auto refused = [&](const char* field, auto& value, auto wrong) {
    const auto before = value;
    value = wrong;
    EXPECT_NE(refusal([&] { check(config); }, Status::usage).find(field), std::string::npos) << field << wrong;
    value = before;
  };
  for (const int wrong : {-1, 0, 17}) refused("passes", config.passes, wrong);
  for (const double wrong : {-0.1, 16.1, std::nan("")}) refused("merge_cell", config.merge_cell, wrong);
  for (const int wrong : {-1, 1001}) refused("fit_epochs", config.fit_epochs, wrong);
  refused("rebase", config.rebase, std::string("move"));
}

// Fields of absent components are not written, since older readers do not know them.
TEST(Config, ExtensionsAreWrittenWhereTheyAreThere) {
  for (const char* part : {"encoder", "vit_r", "vit_q", "poses", "share"})
    EXPECT_EQ(to_json(Config()).find(part), std::string::npos) << part;
  const Config dinov3 = with_fields(Config(), {"encoder=dinov3", "vit_rope_periods=bf16"});
  EXPECT_EQ(json::parse(to_json(dinov3)).at("vit_registers"), 4);
  EXPECT_EQ(to_json(dinov3).find("share"), std::string::npos);
  EXPECT_EQ(config_from_json(to_json(dinov3)), dinov3);
  const Config predicted = with_fields(Config(), {"poses=predicted", "share_reduce=64,32", "share_ray_mlp=1.5"});
  EXPECT_EQ(json::parse(to_json(predicted)).at("share_max_views"), 4);
  EXPECT_EQ(config_from_json(to_json(predicted)), predicted);
  for (const char* name : {"paper", "small", "tiny"})
    EXPECT_NO_THROW(with_fields(named_config(name), {"encoder=dinov3", "poses=predicted", "vit_heads=6"})) << name;
}

TEST(Config, AbsentFieldsTakeTheirDefaults) {
  Config expected;
  expected.volume_mult = {1, 2, 4};
  expected.opacity_threshold = 0;
  EXPECT_EQ(config_from_json(R"({"volume_mult": [1, 2, 4], "opacity_threshold": 0})"), expected);
  EXPECT_EQ(config_from_json("{}"), Config());
}

TEST(Config, RefusesUnknownAndMistypedFieldsByName) {
  const auto message = [](const std::string& text) { return refusal([&] { config_from_json(text); }, Status::format); };
  EXPECT_NE(message(R"({"vit_dims": 3, "colour": 1})").find("\"colour\", \"vit_dims\""), std::string::npos);
  const char* wrong[][2] = {{"image", R"("512")"},
                            {"image", "512.0"},
                            {"image", "true"},
                            {"image", "4294967808"},
                            {"image", "-99999999999"},
                            {"image", "null"},
                            {"volume_mult", "1"},
                            {"volume_mult", "[1,2.5]"},
                            {"volume_mult", R"(["1"])"},
                            {"use_projected", "1"},
                            {"use_projected", R"("true")"},
                            {"opacity_threshold", R"("0.1")"},
                            {"levels", "1"},
                            {"selection", "[]"}};
  for (const auto& [field, value] : wrong) {
    const std::string text = message(std::string("{\"") + field + "\": " + value + "}");
    EXPECT_NE(text.find(field), std::string::npos) << text;
    EXPECT_NE(text.find(value), std::string::npos) << text;
    EXPECT_NE(text.find("must be"), std::string::npos) << text;
  }
  for (const char* text : {"", "[]", "{", "3", "{\"image\": 512,}", "\xff"}) message(text);
}

TEST(Config, SetsFieldsByType) {
  const Config c =
      with_fields(named_config("tiny"), {"fine_count=1", "levels=coarse", "use_projected=false", "volume_mult=1,2",
                                         "opacity_threshold=0.1", "negate_camera_centre=true"});
  EXPECT_EQ(c.fine_count, 1);
  EXPECT_EQ(c.levels, "coarse");
  EXPECT_FALSE(c.use_projected);
  EXPECT_TRUE(c.negate_camera_centre);
  EXPECT_EQ(c.opacity_threshold, 0.1);
  EXPECT_EQ(c.volume_mult, (std::vector<int>{1, 2}));
  // Together they may be valid where each alone is not.
  EXPECT_NO_THROW(with_fields(named_config("tiny"), {"volume=12", "volume_mult=1,1,1", "groups=4"}));
}

TEST(Config, RefusesAssignmentsByName) {
  const char* wrong[][2] = {{"fine_count", "FIELD=VALUE"},
                            {"=1", "no field"},
                            {"fine_counts=1", "no field \"fine_counts\""},
                            {"fine_count=", "whole number"},
                            {"fine_count=1.5", "1.5"},
                            {"fine_count= 1", "whole number"},
                            {"fine_count=99999999999", "999"},
                            {"use_projected=1", "true or false"},
                            {"volume_mult=", "whole numbers"},
                            {"volume_mult=1,,2", "1,,2"},
                            {"volume_mult=1,2,", "1,2,"},
                            {"opacity_threshold=x", "a number"},
                            {"levels=", "levels must be one of fine, skeletal, coarse"},
                            {"opacity_threshold=nan", "[0,1)"},
                            {"opacity_threshold=inf", "[0,1)"},
                            {"levels=Fine", "\"Fine\""}};
  for (const auto& [assignment, word] : wrong) {
    const std::string text = refusal([&, a = assignment] { with_fields(Config(), {a}); }, Status::usage);
    EXPECT_NE(text.find(word), std::string::npos) << text << "\nfor " << assignment;
  }
}

TEST(Config, RefusesWhatCannotBeBuiltWithTheValueFound) {
  struct Case {
    std::vector<std::string> set;
    const char* words;
  };
  const Case cases[] = {
      {{"image=0"}, "image must be at least 1 (found 0)"},
      {{"patch=-16"}, "patch must be at least 1 (found -16)"},
      {{"groups=0"}, "groups must be at least 1 (found 0)"},
      {{"voxel_levels=0"}, "voxel_levels must be at least 1 (found 0)"},
      {{"image=10", "patch=2"}, "image must be at least 11, SSIM's window (found 10)"},
      {{"volume_mult=1,0"}, "volume_mult must be positive (found [1, 0])"},
      {{"opacity_threshold=1"}, "opacity_threshold must be in [0,1) (found 1)"},
      {{"opacity_threshold=-0.5"}, "opacity_threshold must be in [0,1) (found -0.5)"},
      {{"image=500"}, "image must be a multiple of patch (found 500 and 16)"},
      {{"vit_heads=7"}, "vit_dim must be a multiple of vit_heads (found 768 and 7)"},
      {{"volume=47"}, "volume must be divisible by 2 for every level of volume_mult but one (found 47 and 2 levels)"},
      {{"volume=42", "volume_mult=1,1,1"}, "for every level"},
      {{"volume_ch=100"}, "volume_ch must be a multiple of groups (found 100 and 32)"},
      {{"voxel_ch=100"}, "voxel_ch must be a multiple of groups (found 100 and 32)"},
      {{"vit_dim=780"}, "voxel_ch + vit_dim must be a multiple of groups (found 1036 and 32)"},
      {{"sh_degree=4"}, "sh_degree must be 0 to 3 (found 4)"},
      {{"sh_degree=-1"}, "sh_degree must be 0 to 3 (found -1)"},
      {{"fine_count=0"}, "fine_count must be at least 1 (found 0)"},
      {{"views=0"}, "views must be 1 to 16 (found 0)"},
      {{"views=17"}, "views must be 1 to 16 (found 17)"},
      {{"refine_out_kernel=2"}, "refine_out_kernel must be 1 or 3 (found 2)"},
      {{"levels=deep"}, "levels must be one of fine, skeletal, coarse (found \"deep\")"},
      {{"selection=all"}, "selection must be one of gumbel, sigmoid, ste, opacity (found \"all\")"},
      {{"view_weight=x"}, "view_weight must be one of depth, distance (found \"x\")"},
      {{"encoder=dinov2"}, "encoder must be one of dino, dinov3 (found \"dinov2\")"},
      {{"encoder=dinov3", "vit_heads=256"}, "vit_dim must be a multiple of 4 vit_heads"},
      {{"encoder=dinov3", "vit_registers=-1"}, "vit_registers must be 0 to 64 (found -1)"},
      {{"encoder=dinov3", "vit_rope_periods=f16"}, "vit_rope_periods must be one of exact, bf16"},
      {{"poses=guessed"}, "poses must be one of given, predicted (found \"guessed\")"},
      {{"poses=predicted", "share_reduce=8"}, "share_reduce must be two widths (found [8])"},
      {{"poses=predicted", "share_reduce=48,32"}, "share_reduce must be multiples of groups (found 48 and 32)"},
      {{"poses=predicted", "share_dim=126"}, "share_dim must be a multiple of 4"},
      {{"poses=predicted", "share_splits=3"}, "image / patch must be a multiple of share_splits (found 32 and 3)"},
      {{"poses=predicted", "share_cross_mask=x"}, "share_cross_mask must be one of tiled, aligned"},
      {{"poses=predicted", "views=5"}, "must be 2 to share_max_views"},
      {{"poses=predicted", "share_ray_heads=7"}, "share_ray_dim must be even and a multiple of share_ray_heads"},
      {{"poses=predicted", "share_loss_weight=-1"}, "share_loss_weight must be 0 to 1e6 (found -1)"},
      {{"rebase=x"}, "rebase must be one of rotate, move (found \"x\")"},
      {{"volume=258"}, "volume must be at most 256 (found 258)"},
      {{"fine_count=2000000000"}, "fine_count must be at most 1024"},
      {{"volume_mult=1,2147483647"}, "volume_mult must be at most 64"},
      {{"volume_mult=1,1,1,1,1,1,1,1,1"}, "volume_mult must have at most 8 levels (found 9)"},
      {{"patch=1"}, "the encoder's values for 16 views"},
      {{"volume=256"}, "the volume's values"},
      {{"volume=4", "volume_ch=4096", "volume_mult=1,64"}, "the elements of volume_network.down_blocks.1"},
  };
  for (const Case& c : cases) {
    const std::string text = refusal([&] { with_fields(Config(), c.set); }, Status::usage);
    EXPECT_NE(text.find(c.words), std::string::npos) << text << "\nexpected " << c.words;
  }
  // Without the projected features the widths need not fit together.
  EXPECT_NO_THROW(with_fields(Config(), {"vit_dim=780", "use_projected=false"}));
}

}  // namespace
}  // namespace vsplat

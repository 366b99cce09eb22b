#include "model/train/train_config.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::refusal;

std::string refused(const std::string& text) {
  return refusal([&] { train_config_from_json(text); }, Status::format);
}

TEST(TrainConfig, DefaultsAreThePapersAndValid) {
  const TrainConfig c;
  EXPECT_NO_THROW(check(c));
  EXPECT_EQ(c.model, named_config("small"));
  const json j = json::parse(to_json(c));
  const json expected = {{"seed", 0},
                         {"steps", 50000},
                         {"lr", 4e-4},
                         {"warmup", 1000},
                         {"tau_first", 1.0},
                         {"tau_last", 0.1},
                         {"tau_steps", 50000},
                         {"extend", json::array()},
                         {"batch", 1},
                         {"accumulate", 1},
                         {"parts", 1},
                         {"beta1", 0.9},
                         {"beta2", 0.95},
                         {"eps", 1e-8},
                         {"clip_norm", 0.5},
                         {"ssim_weight", 0.5},
                         {"alpha_weight", 0.0},
                         {"sparsity_weight", 0.0},
                         {"fine_after", 0},
                         {"first_listed", 0.0},
                         {"surface_after", 0},
                         {"distortion_weight", 0.0},
                         {"normal_weight", 0.0},
                         {"weight_decay", 0.05},
                         {"optimizer", "adamw"},
                         {"momentum", 0.95},
                         {"ema", 0.0},
                         {"inputs_min", 4},
                         {"inputs_max", 4},
                         {"novel", 4},
                         {"fit", "auto"},
                         {"half_size", 0.0},
                         {"turn_degrees", 0.0},
                         {"cube_min", 1.0},
                         {"cube_max", 1.0},
                         {"mirror", 0.0},
                         {"shuffle_channels", 0.0},
                         {"rooms", 0.0},
                         {"pose_noise", 0.0},
                         {"procedural", 0.0},
                         {"log_every", 10},
                         {"sheet_every", 500},
                         {"keep_checkpoints", 3},
                         {"checkpoint_every", 500},
                         {"cache_gib", 1.0},
                         {"frozen", json::array()},
                         {"random_background", true},
                         {"model", json::parse(to_json(named_config("small")))}};
  EXPECT_EQ(j, expected);
  EXPECT_EQ(train_config_from_json("{}"), c);
}

TEST(TrainConfig, ComesBackFromItsJsonToTheBit) {
  TrainConfig c;
  c.model = with_fields(named_config("tiny"), {"selection=ste", "opacity_threshold=0.1"});
  c.seed = 18446744073709551615u;
  c.schedule = {0.1 + 0.2, 7, 77, 0.9, 1e-3, 13, {5, 1000000000}};
  c.batch = 3, c.accumulate = 2, c.parts = 5;
  c.beta1 = 0.1, c.beta2 = 1.0 / 3, c.eps = 1e-300, c.weight_decay = 0, c.clip_norm = 1e9, c.ssim_weight = 0.25,
  c.alpha_weight = 0.1, c.sparsity_weight = 0.01;
  c.optimizer = "muon", c.momentum = 0.9;
  c.ema = 0.999;
  c.frozen = {"encoder.model.blocks.0", "dir_norm"};
  c.inputs_min = 2, c.inputs_max = 4, c.novel = 0;
  c.random_background = false;
  c.crop = "pad", c.turn_degrees = 12.5, c.cube_min = 0.7, c.cube_max = 1.1, c.procedural = 0.3, c.pose_noise = 0.02;
  c.mirror = 0.5, c.shuffle_channels = 0.6;
  c.half_size = 0.4, c.rooms = 0.2;
  c.log_every = 0, c.sheet_every = 5, c.checkpoint_every = 11, c.keep_checkpoints = 1, c.cache_gib = 0.25;
  const std::string text = to_json(c);
  EXPECT_EQ(train_config_from_json(text), c);
  EXPECT_EQ(to_json(train_config_from_json(text)), text);
  EXPECT_EQ(hash_of(train_config_from_json(text)), hash_of(c));
  TrainConfig other = c;
  other.cache_gib = 0.5;
  EXPECT_NE(hash_of(other), hash_of(c));
  EXPECT_EQ(hash_of(c).size(), 64u);
}

TEST(TrainConfig, ModelIsANameOrFieldsOverOne) {
  const auto model = [](const std::string& value) {
    return train_config_from_json("{\"model\": " + value + "}").model;
  };
  EXPECT_EQ(model(R"("tiny")"), named_config("tiny"));
  EXPECT_EQ(model(R"({"base": "tiny"})"), named_config("tiny"));
  EXPECT_EQ(model(R"({"base": "tiny", "fine_count": 1})"), with_fields(named_config("tiny"), {"fine_count=1"}));
  EXPECT_EQ(model(R"({"fine_count": 1})"), with_fields(named_config("small"), {"fine_count=1"}));
  EXPECT_EQ(model("{}"), named_config("small"));
}

TEST(TrainConfig, LarasNetworkBySystem) {
  const TrainConfig c =
      train_config_from_json(R"({"model": {"system": "lara", "base": "tiny", "out_ch": 8}, "steps": 1000})");
  EXPECT_EQ(c.model, AnyConfig(with_fields(AnyConfig(named_lara_config("tiny")), {"out_ch=8"})));
  EXPECT_EQ(c.inputs_max, 3);
  EXPECT_EQ(c.fine_after, 100);
  EXPECT_EQ(c.surface_after, 20);
  EXPECT_EQ(c.distortion_weight, 1000);
  EXPECT_EQ(c.normal_weight, 0.2);
  EXPECT_EQ(train_config_from_json(to_json(c)), c);
  EXPECT_EQ(to_json(train_config_from_json(to_json(c))), to_json(c));
  // The published configuration at its full length.
  const TrainConfig whole = train_config_from_json(R"({"model": {"system": "lara", "base": "published"}})");
  EXPECT_EQ(whole.model, AnyConfig(LaraConfig()));
  EXPECT_EQ(whole.fine_after, 5000);
  EXPECT_EQ(whole.surface_after, 1000);
  // Volumes have no surface terms.
  const TrainConfig flat =
      train_config_from_json(R"({"model": {"system": "lara", "base": "tiny", "kind": "gaussian"}})");
  EXPECT_EQ(flat.distortion_weight, 0);

  const auto problem = [](const std::string& text) {
    return test::refusal([&] { train_config_from_json(text); }, Status::format);
  };
  EXPECT_NE(problem(R"({"model": {"system": "larra"}})").find("this vsplat has vsplat, lara"), std::string::npos);
  EXPECT_NE(problem(R"({"model": {"system": "lara", "base": "paper"}})").find("published"), std::string::npos);
  EXPECT_NE(problem(R"({"model": {"system": "lara", "fine_count": 2}})").find("fine_count"), std::string::npos);
  EXPECT_NE(problem(R"({"model": {"system": "lara", "base": "tiny"}, "inputs_max": 5})").find("inputs_max"),
            std::string::npos);
  EXPECT_NE(problem(R"({"model": "tiny", "normal_weight": 0.1})").find("surfels"), std::string::npos);
  EXPECT_NE(problem(R"({"model": "tiny", "fine_after": 1})").find("fine_after"), std::string::npos);
  EXPECT_NE(problem(R"({"model": {"system": "lara", "base": "tiny"}, "distortion_weight": -1})").find("at least 0"),
            std::string::npos);
}

TEST(TrainConfig, NumbersOfViewsAreTheModelsWhereAbsent) {
  const TrainConfig three = train_config_from_json(R"({"model": "tiny"})");
  EXPECT_EQ(three.inputs_min, 3);
  EXPECT_EQ(three.inputs_max, 3);
  EXPECT_EQ(three.novel, 3);
  const TrainConfig some = train_config_from_json(R"({"model": "tiny", "inputs_min": 2, "novel": 1})");
  EXPECT_EQ(some.inputs_min, 2);
  EXPECT_EQ(some.inputs_max, 3);
  EXPECT_EQ(some.novel, 1);
}

TEST(TrainConfig, SchedulesFollowTheStepsWhereAbsent) {
  const auto schedule = [](const std::string& text) { return train_config_from_json(text).schedule; };
  EXPECT_EQ(schedule(R"({"steps": 10})").warmup, 1);
  EXPECT_EQ(schedule(R"({"steps": 600})").warmup, 12);
  EXPECT_EQ(schedule(R"({"steps": 20000})").warmup, 400);
  EXPECT_EQ(schedule(R"({"steps": 500000})").warmup, 1000);
  EXPECT_EQ(schedule(R"({"steps": 10, "warmup": 3})").warmup, 3);
  EXPECT_EQ(schedule(R"({"steps": 20000})").tau_steps, 20000);
  EXPECT_NEAR(temperature(schedule(R"({"steps": 20000})"), 20000), 0.1, 1e-4);
  EXPECT_EQ(schedule(R"({"steps": 20000, "tau_steps": 7})").tau_steps, 7);
  for (const char* text : {"{}", R"({"steps": 1})", R"({"steps": 600})", R"({"steps": 20000})"})
    EXPECT_TRUE(unfinished(schedule(text)).empty()) << text;
}

TEST(TrainConfig, StagesAreFieldsOverThoseBesideThem) {
  const auto stages = [](const std::string& text) { return train_stages_from_json(text); };
  const std::string text = R"({"model": "tiny", "seed": 5, "lr": 0.01, "stages": [
      {"steps": 1000},
      {"steps": 50, "lr": 0.001, "model": {"image": 96, "volume": 20}},
      {"steps": 50, "seed": 9, "model": {"base": "micro"}}]})";
  const std::vector<TrainConfig> got = stages(text);
  ASSERT_EQ(got.size(), 3u);
  EXPECT_EQ(got[0].model, named_config("tiny"));
  EXPECT_EQ(got[1].model, with_fields(named_config("tiny"), {"image=96", "volume=20"}));
  EXPECT_EQ(got[2].model, named_config("micro"));
  EXPECT_EQ(got[0].schedule.lr, 0.01);
  EXPECT_EQ(got[1].schedule.lr, 0.001);
  EXPECT_EQ(got[0].schedule.tau_steps, 1000);
  EXPECT_EQ(got[1].schedule.tau_steps, 50);
  EXPECT_EQ(got[0].schedule.warmup, 20);
  EXPECT_EQ(got[1].schedule.warmup, 1);
  EXPECT_EQ(got[0].seed, 5u);
  EXPECT_EQ(got[1].seed, 6u);
  EXPECT_EQ(got[2].seed, 9u);
  EXPECT_EQ(stages(to_json(got)), got);
  EXPECT_EQ(to_json(stages(to_json(got))), to_json(got));
  EXPECT_EQ(stages(R"({"steps": 7})"), std::vector<TrainConfig>{train_config_from_json(R"({"steps": 7})")});
  const TrainConfig fields =
      stages(R"({"model": {"base": "tiny", "volume": 20}, "stages": [{"model": {"image": 96}}]})")[0];
  EXPECT_EQ(fields.model, got[1].model);
  const char* wrong[][2] = {
      {R"({"stages": {}})", "must be a list of 1 to 100 objects (found {})"},
      {R"({"stages": []})", "must be a list of 1 to 100 objects (found [])"},
      {R"({"stages": [{}, 3]})", "stage 2 must be an object (found 3)"},
      {R"({"stages": [{}, {"step": 3}]})", "stage 2: the training's configuration has unknown fields"},
      {R"({"stages": [{"stages": [{}]}]})", "unknown fields: \"stages\""},
      {R"({"steps": 5, "stages": [{"warmup": 6}]})", "stage 1: the training's configuration: warmup"}};
  for (const auto& [bad, words] : wrong) {
    const std::string message = refusal([&, &bad = bad] { train_stages_from_json(bad); }, Status::format);
    EXPECT_NE(message.find(words), std::string::npos) << message << "\nexpected " << words;
  }
}

TEST(TrainConfig, FreezesByTheStartOfNames) {
  const TrainConfig c = train_config_from_json(R"({"frozen": ["encoder.model.blocks.0.", "dir_norm"]})");
  EXPECT_TRUE(is_frozen(c, "encoder.model.blocks.0.norm1.weight"));
  EXPECT_TRUE(is_frozen(c, "dir_norm.mlp.0.bias"));
  EXPECT_FALSE(is_frozen(c, "encoder.model.blocks.1.norm1.weight"));
  EXPECT_FALSE(is_frozen(TrainConfig(), "dir_norm.mlp.0.bias"));
}

TEST(TrainConfig, RefusesUnknownAndMistypedFieldsByName) {
  EXPECT_NE(refused(R"({"step": 3, "colour": 1})").find("unknown fields: \"colour\", \"step\"; known are model, seed"),
            std::string::npos);
  EXPECT_NE(refused(R"({"model": {"base": "tiny", "vit": 1}})").find("unknown fields: \"vit\""), std::string::npos);
  const char* wrong[][2] = {{"seed", "-1"},      {"seed", "1.0"},           {"seed", "18446744073709551616"},
                            {"steps", "\"10\""}, {"steps", "10.0"},         {"steps", "9223372036854775808"},
                            {"steps", "null"},   {"lr", "\"4e-4\""},        {"random_background", "1"},
                            {"fit", "[]"},       {"frozen", "\"encoder\""}, {"frozen", "[1]"},
                            {"extend", "5"},     {"extend", "[1.5]"},       {"turn_degrees", "[]"},
                            {"model", "3"},      {"cache_gib", "true"}};
  for (const auto& [field, value] : wrong) {
    const std::string text = refused(std::string("{\"") + field + "\": " + value + "}");
    EXPECT_NE(text.find(field), std::string::npos) << text;
    EXPECT_NE(text.find("must be"), std::string::npos) << text;
    EXPECT_NE(text.find("(found "), std::string::npos) << text;
  }
  EXPECT_NE(refused(R"({"model": {"base": 3}})").find("base must be a string (found 3)"), std::string::npos);
  EXPECT_NE(refused(R"({"model": "huge"})").find("paper, small, tiny, micro"), std::string::npos);
  EXPECT_NE(refused(R"({"model": {"base": "huge"}})").find("paper, small, tiny, micro"), std::string::npos);
  for (const char* text : {"[]", "3"}) EXPECT_NE(refused(text).find("not a JSON object"), std::string::npos);
  for (const char* text : {"", "{", "{\"steps\": 512,}", "\xff"})
    EXPECT_NE(refused(text).find("not valid JSON"), std::string::npos);
}

TEST(TrainConfig, RefusesWhatCannotBeTrainedWithTheValueFound) {
  const char* cases[][2] = {
      {R"({"steps": 0})", "steps must be 1 to 1000000000 (found 0)"},
      {R"({"steps": 10, "warmup": 1000})", "warmup must be 0 to 10 (found 1000)"},
      {R"({"lr": 0})", "lr must be above 0 and at most 1 (found 0)"},
      {R"({"tau_first": 0})", "tau_first must be above 0 (found 0)"},
      {R"({"tau_last": -1})", "tau_last must be above 0 (found -1)"},
      {R"({"extend": [5, 0]})", "each of extend must be 1 to 1000000000 (found 0)"},
      {R"({"batch": 0})", "batch must be 1 to 1024 (found 0)"},
      {R"({"accumulate": 0})", "accumulate must be 1 to 1024 (found 0)"},
      {R"({"batch": 2, "accumulate": 3, "parts": 7})", "parts must be 1 to 6 (found 7)"},
      {R"({"beta1": 1})", "beta1 must be at least 0 and below 1 (found 1)"},
      {R"({"beta2": -0.5})", "beta2 must be at least 0 and below 1 (found -0.5)"},
      {R"({"optimizer": "sgd"})", "optimizer must be one of adamw, muon (found \"sgd\")"},
      {R"({"momentum": 1})", "momentum must be at least 0 and below 1 (found 1)"},
      {R"({"ema": 1})", "ema must be at least 0 and below 1 (found 1)"},
      {R"({"eps": 0})", "eps must be above 0 (found 0)"},
      {R"({"weight_decay": -1})", "weight_decay must be at least 0 (found -1)"},
      {R"({"clip_norm": 0})", "clip_norm must be above 0 (found 0)"},
      {R"({"ssim_weight": -1})", "ssim_weight must be at least 0 (found -1)"},
      {R"({"alpha_weight": -1})", "alpha_weight must be at least 0 (found -1)"},
      {R"({"sparsity_weight": -1})", "sparsity_weight must be at least 0 (found -1)"},
      {R"({"frozen": ["encode", "encoders"]})", "frozen must be the beginning of a parameter's name"},
      {R"({"frozen": [""]})", "(found \"\")"},
      {R"({"frozen": ["encoder", "dir_norm", "volume", "voxel", "predictor"]})", "must leave something to train"},
      {R"({"inputs_max": 17})", "inputs_max must be 1 to 16 (found 17)"},
      {R"({"inputs_min": 5})", "inputs_min must be 1 to 4 (found 5)"},
      {R"({"inputs_min": 0})", "inputs_min must be 1 to 4 (found 0)"},
      {R"({"novel": -1})", "novel must be 0 to 64 (found -1)"},
      {R"({"fit": "wide"})", "fit must be one of auto, object, crop, pad (found \"wide\")"},
      {R"({"half_size": -0.5})", "half_size must be 0 to 1 (found -0.5)"},
      {R"({"model": {"base": "micro", "image": 16}, "half_size": 0.5})",
       "half_size must be 0: the model's image of 16 pixels is odd or below 22 (found 0.5)"},
      {R"({"turn_degrees": 181})", "turn_degrees must be 0 to 180 (found 181)"},
      {R"({"cube_max": 11})", "cube_max must be 0.1 to 10 (found 11)"},
      {R"({"pose_noise": -0.1})", "pose_noise must be 0 to 1 (found -0.1)"},
      {R"({"model": {"base": "tiny", "poses": "predicted"}, "inputs_min": 1})", "inputs_min must be 2 to 3 (found 1)"},
      {R"({"model": {"base": "tiny", "poses": "predicted"}, "inputs_max": 5})", "inputs_max must be 2 to 4 (found 5)"},
      {R"({"procedural": 1.5})", "procedural must be 0 to 1 (found 1.5)"},
      {R"({"mirror": 1.5})", "mirror must be 0 to 1 (found 1.5)"},
      {R"({"rooms": 1.01})", "rooms must be 0 to 1 (found 1.01)"},
      {R"({"shuffle_channels": -1})", "shuffle_channels must be 0 to 1 (found -1"},
      {R"({"cube_min": 1.5})", "cube_min must be 0.1 to cube_max (found 1.5)"},
      {R"({"log_every": -1})", "log_every must be 0 to"},
      {R"({"sheet_every": -1})", "sheet_every must be 0 to"},
      {R"({"checkpoint_every": -1})", "checkpoint_every must be 0 to"},
      {R"({"keep_checkpoints": 0})", "keep_checkpoints must be 1 to"},
      {R"({"cache_gib": -1})", "cache_gib must be 0 to"},
      {R"({"model": {"image": 10, "patch": 2}})", "image must be at least 11"},
  };
  for (const auto& [text, words] : cases) {
    const std::string message = refused(text);
    EXPECT_NE(message.find(words), std::string::npos) << message << "\nexpected " << words;
  }
  TrainConfig broken;
  broken.schedule.lr = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(refusal([&] { check(broken); }, Status::usage).find("lr must be"), std::string::npos);
}

}  // namespace
}  // namespace vsplat

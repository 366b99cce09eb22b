#include "model/train/train_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/base/field_checks.h"
#include "model/base/json_fields.h"
#include "model/networks/params/params.h"
#include "runtime/fail.h"
#include "runtime/files/sha256.h"
#include "runtime/json_text.h"

namespace vsplat {
namespace {

using json_fields::json;
using json_fields::shown;
using nlohmann::ordered_json;

constexpr const char* kWhat = "the training's configuration";
constexpr const char* kBase = "small";

// The list of fields except `model`: calls visit(name, field) for each, in the order of the JSON.
template <class C, class Visit>
void each_field(C& c, Visit visit) {
  visit("seed", c.seed);
  visit("steps", c.schedule.steps);
  visit("lr", c.schedule.lr);
  visit("warmup", c.schedule.warmup);
  visit("tau_first", c.schedule.tau_first);
  visit("tau_last", c.schedule.tau_last);
  visit("tau_steps", c.schedule.tau_steps);
  visit("extend", c.schedule.extend);
  visit("batch", c.batch);
  visit("accumulate", c.accumulate);
  visit("parts", c.parts);
  visit("optimizer", c.optimizer);
  visit("beta1", c.beta1);
  visit("beta2", c.beta2);
  visit("eps", c.eps);
  visit("weight_decay", c.weight_decay);
  visit("momentum", c.momentum);
  visit("clip_norm", c.clip_norm);
  visit("ssim_weight", c.ssim_weight);
  visit("alpha_weight", c.alpha_weight);
  visit("sparsity_weight", c.sparsity_weight);
  visit("fine_after", c.fine_after);
  visit("surface_after", c.surface_after);
  visit("distortion_weight", c.distortion_weight);
  visit("normal_weight", c.normal_weight);
  visit("ema", c.ema);
  visit("frozen", c.frozen);
  visit("inputs_min", c.inputs_min);
  visit("inputs_max", c.inputs_max);
  visit("first_listed", c.first_listed);
  visit("novel", c.novel);
  visit("random_background", c.random_background);
  visit("fit", c.crop);
  visit("half_size", c.half_size);
  visit("turn_degrees", c.turn_degrees);
  visit("cube_min", c.cube_min);
  visit("cube_max", c.cube_max);
  visit("mirror", c.mirror);
  visit("shuffle_channels", c.shuffle_channels);
  visit("rooms", c.rooms);
  visit("pose_noise", c.pose_noise);
  visit("procedural", c.procedural);
  visit("log_every", c.log_every);
  visit("sheet_every", c.sheet_every);
  visit("checkpoint_every", c.checkpoint_every);
  visit("keep_checkpoints", c.keep_checkpoints);
  visit("cache_gib", c.cache_gib);
}

std::vector<std::string> field_names() {
  std::vector<std::string> names = {"model"};
  const TrainConfig defaults;
  each_field(defaults, [&](const char* name, const auto&) { names.emplace_back(name); });
  return names;
}

void check_optimiser(const TrainConfig& c, const FieldChecks& is) {
  constexpr long kMostSteps = 1'000'000'000;
  const Schedule& s = c.schedule;
  is.within("steps", s.steps, 1, kMostSteps);
  is.in("lr", s.lr, s.lr > 0 && s.lr <= 1, "above 0 and at most 1");
  is.within("warmup", s.warmup, 0, s.steps);
  is.in("tau_first", s.tau_first, s.tau_first > 0, "above 0");
  is.in("tau_last", s.tau_last, s.tau_last > 0, "above 0");
  is.within("tau_steps", s.tau_steps, 0, kMostSteps);
  is.within("extend's number of elements", static_cast<long>(s.extend.size()), 0, 1000);
  for (const long more : s.extend) is.within("each of extend", more, 1, kMostSteps);
  is.within("batch", c.batch, 1, 1024);
  is.within("accumulate", c.accumulate, 1, 1024);
  is.within("parts", c.parts, 1, c.batch * c.accumulate);
  is.one_of("optimizer", c.optimizer, {"adamw", "muon"});
  for (const auto& [name, value] :
       {std::pair{"beta1", c.beta1}, {"beta2", c.beta2}, {"momentum", c.momentum}, {"ema", c.ema}})
    is.in(name, value, value >= 0 && value < 1, "at least 0 and below 1");
  is.in("eps", c.eps, c.eps > 0, "above 0");
  is.in("weight_decay", c.weight_decay, c.weight_decay >= 0, "at least 0");
  is.in("clip_norm", c.clip_norm, c.clip_norm > 0, "above 0");
  is.in("ssim_weight", c.ssim_weight, c.ssim_weight >= 0, "at least 0");
  is.in("alpha_weight", c.alpha_weight, c.alpha_weight >= 0, "at least 0");
  is.in("sparsity_weight", c.sparsity_weight, c.sparsity_weight >= 0, "at least 0");
  is.within("fine_after", c.fine_after, 0, c.model.get_if<LaraConfig>() ? kMostSteps : 0);
  is.within("surface_after", c.surface_after, 0, kMostSteps);
  for (const auto& [name, value] :
       {std::pair{"distortion_weight", c.distortion_weight}, {"normal_weight", c.normal_weight}})
    if (c.model.has_surfels())
      is.in(name, value, value >= 0, "at least 0");
    else
      is.in(name, value, value == 0, "0: the model is not one of surfels");
}

void check_frozen(const TrainConfig& c, const FieldChecks& is) {
  const std::vector<Parameter> all = parameters(c.model);
  for (const std::string& prefix : c.frozen)
    is.need(!prefix.empty() &&
                std::any_of(all.begin(), all.end(), [&](const Parameter& p) { return p.name.starts_with(prefix); }),
            "each of frozen must be the beginning of a parameter's name, as encoder. or predictor.", shown(prefix));
  is.need(std::any_of(all.begin(), all.end(), [&](const Parameter& p) { return p.trained && !is_frozen(c, p.name); }),
          "frozen must leave something to train", shown(c.frozen));
}

void check_views(const TrainConfig& c, const FieldChecks& is) {
  const Config* own = c.model.as<Config>();
  const long fewest = own && own->predicts_poses() ? 2 : 1;
  is.within("inputs_max", c.inputs_max, fewest, c.model.taken().most);
  is.within("inputs_min", c.inputs_min, fewest, c.inputs_max);
  is.in("first_listed", c.first_listed, c.first_listed >= 0 && c.first_listed <= 1, "0 to 1");
  is.within("novel", c.novel, 0, 64);
  is.one_of("fit", c.crop, {"auto", "object", "crop", "pad"});
  is.in("half_size", c.half_size, c.half_size >= 0 && c.half_size <= 1, "0 to 1");
  if (c.half_size > 0 && (c.model.image() % 2 != 0 || c.model.image() < 22))  // SSIM has windows of 11 pixels
    is.in("half_size", c.half_size, false,
          fmt::format("0: the model's image of {} pixels is odd or below 22", c.model.image()).c_str());
  is.in("turn_degrees", c.turn_degrees, c.turn_degrees >= 0 && c.turn_degrees <= 180, "0 to 180");
  is.in("cube_max", c.cube_max, c.cube_max >= 0.1 && c.cube_max <= 10, "0.1 to 10");
  is.in("cube_min", c.cube_min, c.cube_min >= 0.1 && c.cube_min <= c.cube_max, "0.1 to cube_max");
  is.in("mirror", c.mirror, c.mirror >= 0 && c.mirror <= 1, "0 to 1");
  is.in("shuffle_channels", c.shuffle_channels, c.shuffle_channels >= 0 && c.shuffle_channels <= 1, "0 to 1");
  is.in("rooms", c.rooms, c.rooms >= 0 && c.rooms <= 1, "0 to 1");
  is.in("pose_noise", c.pose_noise, c.pose_noise >= 0 && c.pose_noise <= 1, "0 to 1");
  is.in("procedural", c.procedural, c.procedural >= 0 && c.procedural <= 1, "0 to 1");
}

AnyConfig read_model(const json& value) {
  if (value.is_string()) return named_config(value.get<std::string>());
  if (!value.is_object())
    fail(Status::format, "model must be one of {}, or an object (found {})", fmt::join(config_names(), ", "),
         shown(value));
  json fields = value;
  std::string base = kBase;
  json_fields::read_present(value, "base", base, "model");
  fields.erase("base");
  return any_config_from_json(fields.dump(), base);
}

}  // namespace

bool is_muons(const TrainConfig& config, const Parameter& p) {
  return config.optimizer == "muon" && p.shape.size() >= 2 && (p.init == Init::fan_in || p.init == Init::submanifold);
}

bool is_frozen(const TrainConfig& config, const std::string& parameter) {
  return std::any_of(config.frozen.begin(), config.frozen.end(),
                     [&](const std::string& prefix) { return parameter.starts_with(prefix); });
}

void check(const TrainConfig& c, Status status) {
  constexpr long kMostSteps = 1'000'000'000;
  check(c.model, status);
  const FieldChecks is(status);
  check_optimiser(c, is);
  check_frozen(c, is);
  check_views(c, is);
  is.within("log_every", c.log_every, 0, kMostSteps);
  is.within("sheet_every", c.sheet_every, 0, kMostSteps);
  is.within("checkpoint_every", c.checkpoint_every, 0, kMostSteps);
  is.within("keep_checkpoints", c.keep_checkpoints, 1, 1'000'000);
  is.in("cache_gib", c.cache_gib, c.cache_gib >= 0 && c.cache_gib <= 1e6, "0 to 1000000");
}

std::string to_json(const TrainConfig& config) {
  ordered_json out = ordered_json::object();
  out["model"] = ordered_json::parse(any_to_json(config.model));
  each_field(config, [&](const char* name, const auto& value) { out[name] = value; });
  return out.dump(2, ' ', true, ordered_json::error_handler_t::replace);
}

namespace {

json parsed(const std::string& text) {
  json object = parse_json(kWhat, text);
  if (!object.is_object()) fail(Status::format, "{} is not a JSON object: {}", kWhat, shown(text));
  return object;
}

// Overrides the common fields by a stage's.
json merged(json base, const json& stage) {
  for (const auto& [name, value] : stage.items()) {
    json& into = base[name];
    const bool fields = name == "model" && value.is_object() && !value.contains("base");
    if (fields && into.is_string()) into = {{"base", into}};
    if (fields && into.is_object())
      into.update(value);
    else
      into = value;
  }
  return base;
}

}  // namespace

std::vector<TrainConfig> train_stages_from_json(const std::string& text) {
  json base = parsed(text);
  if (!base.contains("stages")) return {train_config_from_json(text)};
  const json stages = base["stages"];
  base.erase("stages");
  if (!stages.is_array() || stages.empty() || stages.size() > 100)
    fail(Status::format, "{}'s stages must be a list of 1 to 100 objects (found {})", kWhat, shown(stages));
  std::vector<TrainConfig> out;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    if (!stages[i].is_object())
      fail(Status::format, "{}'s stage {} must be an object (found {})", kWhat, i + 1, shown(stages[i]));
    try {
      out.push_back(train_config_from_json(merged(base, stages[i]).dump()));
    } catch (const Error& e) {
      fail(e.status(), "stage {}: {}", i + 1, e.what());
    }
    if (!stages[i].contains("seed")) out.back().seed += i;
  }
  return out;
}

std::string to_json(const std::vector<TrainConfig>& stages) {
  if (stages.size() == 1) return to_json(stages.front());
  ordered_json out = {{"stages", ordered_json::array()}};
  for (const TrainConfig& stage : stages) out["stages"].push_back(ordered_json::parse(to_json(stage)));
  return out.dump(2, ' ', true, ordered_json::error_handler_t::replace);
}

TrainConfig train_config_from_json(const std::string& text) {
  const json object = parsed(text);
  json_fields::refuse_unknown(object, field_names(), kWhat);
  TrainConfig config;
  if (const auto model = object.find("model"); model != object.end()) {
    try {
      config.model = read_model(*model);
    } catch (const Error& e) {
      fail(Status::format, "{}: model: {}", kWhat, e.what());
    }
  }
  config.inputs_min = config.inputs_max = config.novel = config.model.taken().trained;
  each_field(config, [&](const char* name, auto& value) { json_fields::read_present(object, name, value, kWhat); });
  if (!object.contains("warmup")) config.schedule.warmup = usual_warmup(config.schedule.steps);
  if (!object.contains("tau_steps")) config.schedule.tau_steps = config.schedule.steps;
  const auto usual = [&](const char* name, auto& field, auto value) {
    if (!object.contains(name)) field = value;
  };
  if (config.model.get_if<LaraConfig>())
    usual("fine_after", config.fine_after, usual_fine_after(config.schedule.steps));
  if (config.model.has_surfels()) {  // as in LaRa's training
    usual("surface_after", config.surface_after, usual_warmup(config.schedule.steps));
    usual("distortion_weight", config.distortion_weight, 1000.0);
    usual("normal_weight", config.normal_weight, 0.2);
  }
  try {
    check(config, Status::format);
  } catch (const Error& e) {
    fail(Status::format, "{}: {}", kWhat, e.what());
  }
  return config;
}

std::string hash_of(const TrainConfig& config) {
  const std::string text = to_json(config);
  Sha256 sha;
  sha.add(text.data(), text.size());
  return sha.hex();
}

}  // namespace vsplat

#include "model/train/beginning.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "model/networks/params/init.h"
#include "model/networks/params/model_file.h"
#include "runtime/fail.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// Clears the fields that may differ between a run and its continuation, since no weight depends on them.
TrainConfig without_habits(TrainConfig config) {
  const TrainConfig defaults;
  config.log_every = defaults.log_every;
  config.sheet_every = defaults.sheet_every;
  config.checkpoint_every = defaults.checkpoint_every;
  config.keep_checkpoints = defaults.keep_checkpoints;
  config.cache_gib = defaults.cache_gib;
  return config;
}

// The first field that differs between two configurations, with both values.
std::string first_difference(const TrainConfig& found, const TrainConfig& expected) {
  using nlohmann::ordered_json;
  const auto compare = [](const ordered_json& a, const ordered_json& b, const auto& self) -> std::string {
    for (const auto& [name, value] : a.items()) {
      const ordered_json other = b.value(name, ordered_json());  // null if the field is absent
      if (value == other) continue;
      if (value.is_object() && other.is_object()) return self(value, other, self);
      return fmt::format("found \"{0}\": {1}, expected \"{0}\": {2}", name, value.dump(), other.dump());
    }
    for (const auto& [name, value] : b.items())
      if (!a.contains(name)) return fmt::format("found no \"{0}\", expected \"{0}\": {1}", name, value.dump());
    return "they differ";
  };
  return compare(ordered_json::parse(to_json(found)), ordered_json::parse(to_json(expected)), compare);
}

// Copies the sizes that may change between trainings. (A densifier's weights depend on those of the volume.)
template <class C>
C with_sizes_of(C config, const C& other) {
  config.image = other.image;
  config.views = other.views;
  if constexpr (std::is_base_of_v<Config, C>)
    config.use_views = other.use_views, config.passes = other.passes, config.merge_cell = other.merge_cell,
    config.fit_epochs = other.fit_epochs;
  if constexpr (std::is_same_v<Config, C>) config.volume = other.volume;
  return config;
}
// A configuration of another architecture is returned unchanged.
AnyConfig with_sizes_of(const AnyConfig& config, const AnyConfig& other) {
  return config.visit([&](const auto& own) {
    const auto* same = other.get_if<std::decay_t<decltype(own)>>();
    return same ? AnyConfig(with_sizes_of(own, *same)) : config;
  });
}

// Rescales weights that depend on the number of voxels if the initial model has another size. Returns a note for the
// user.
std::string adapt(Weights& weights, const Config& from, const Config& to, const std::string& path) {
  if (from.volume == to.volume && from.image == to.image) return "";
  const double factor = static_cast<double>(from.volume) / static_cast<double>(to.volume);
  const std::size_t scaled = scale_places(weights, to, factor);
  std::string note = fmt::format("{}: made for pictures of {} pixels and {} voxels an edge, continues with {} and {}",
                                 path, from.image, from.volume, to.image, to.volume);
  if (from.volume != to.volume) note += fmt::format("; {} places within a voxel scaled by {:g}", scaled, factor);
  return note;
}
std::string adapt(Weights&, const LaraConfig& from, const LaraConfig& to, const std::string& path) {
  if (from.image == to.image) return "";
  return fmt::format("{}: made for pictures of {} pixels, continues with {}", path, from.image, to.image);
}

// The checkpoint with the requested configuration. Refuses a configuration that disagrees on the steps so far.
Checkpoint continued(Checkpoint found, const TrainConfig& config, const BeginningRequest& request) {
  TrainConfig asked = config;
  if (!request.extend.empty()) asked.schedule.extend = request.extend;
  if (asked.schedule.extend.empty()) asked.schedule.extend = found.config.schedule.extend;
  check(asked);
  TrainConfig same = without_habits(found.config);
  const TrainConfig wanted = without_habits(asked);
  if (extended_alike(same.schedule, wanted.schedule, found.step)) same.schedule.extend = wanted.schedule.extend;
  if (same != wanted)
    fail(Status::usage,
         "{}: the checkpoint of step {} is of another configuration than the one given: {}; name another folder, or "
         "give the checkpoint's configuration, which is in config.json there",
         request.output, found.step, first_difference(same, wanted));
  found.config = asked;
  return found;
}

}  // namespace

Checkpoint random_beginning(const TrainConfig& config) {
  Checkpoint out;
  out.config = config;
  out.parameters = initial_weights(config.model, config.seed);
  return out;
}

void check_model_fits(const AnyConfig& model, const TrainConfig& config) {
  TrainConfig other = config;
  other.model = with_sizes_of(model, config.model);
  if (other != config) fail(Status::format, "{}", first_difference(other, config));
}

Beginning from_model(const TrainConfig& config, const std::string& path) {
  AnyModel file = load_any_model(SafetensorsFile(path));
  return std::visit(
      [&](auto& model) {
        try {
          check_model_fits(model.config, config);
        } catch (const Error& e) {
          fail(e.status(),
               "{}: its model differs from the configuration's \"model\", which may differ only in image, volume, "
               "views, use_views, passes, merge_cell and fit_epochs: {}",
               path, e.what());
        }
        Beginning out;
        out.checkpoint.config = config;
        const auto& asked = *config.model.get_if<std::decay_t<decltype(model.config)>>();
        out.note = adapt(model.weights, model.config, asked, path);
        out.checkpoint.parameters = std::move(model.weights);
        return out;
      },
      file);
}

Beginning begin(const TrainConfig& config, const BeginningRequest& request) {
  if (!request.extend.empty() && !request.resume)
    fail(Status::usage, "{} needs {}: it continues a training", Option::extend, Option::train_resume);
  std::optional<Checkpoint> found;
  if (fs::exists(request.output)) found = newest_checkpoint(request.output);
  if (found && !request.resume)
    fail(Status::usage,
         "{}: holds a training's checkpoints already (step {}): {} continues from them; or name another folder",
         request.output, found->step, Option::train_resume);
  if (found) return {continued(std::move(*found), config, request), ""};
  if (!request.extend.empty())
    fail(Status::usage, "{}: holds no checkpoint that {} could continue from; train first, then extend", request.output,
         Option::extend);
  if (request.init.empty()) return {random_beginning(config), ""};
  return from_model(config, request.init);
}

}  // namespace vsplat

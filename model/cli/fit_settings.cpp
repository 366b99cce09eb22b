#include "fit_settings.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "arguments.h"
#include "request_fields.h"

namespace command {
namespace {

using nlohmann::ordered_json;

constexpr const char* beside_scene = "Beside the scene";

// "steps" of --steps.
std::string field_of(const CLI::Option& option) { return option.get_lnames().front(); }

bool is_flag(const CLI::Option& option) { return option.get_expected_min() == 0; }

[[noreturn]] void wrong(const std::string& where, const std::string& expected, const ordered_json& found) {
  throw UsageError(where + " is " + short_text(found) + ": " + expected + " expected");
}

// A field's value as the command line would give it.
std::string text_of(const ordered_json& value, const std::string& where) {
  if (value.is_string() && !value.get<std::string>().empty()) return value.get<std::string>();
  if (value.is_number()) return value.dump();
  if (!value.is_array() || value.empty()) wrong(where, "a text, a number or a list of them", value);
  std::string out;
  for (const ordered_json& each : value) {
    if (!each.is_string() && !each.is_number()) wrong(where, "a list of texts or numbers", value);
    if (each.is_string() && each.get<std::string>().find(',') != std::string::npos)
      wrong(where, "a list of texts without commas, which separate them", value);
    out += (out.empty() ? "" : ",") + (each.is_string() ? each.get<std::string>() : each.dump());
  }
  return out;
}

ordered_json value_of(const CLI::Option& option) {
  const bool given = option.count() > 0;
  if (is_flag(option)) return given && option.as<bool>();
  if (!given) return nullptr;
  const std::string text = option.results().back();
  // A name like 1.50 stays a text: as a number it would be given back as 1.5.
  const ordered_json number = ordered_json::parse(text, nullptr, false);
  return number.is_number() && number.dump() == text ? number : ordered_json(text);
}

}  // namespace

ordered_json settings_in(const std::vector<CLI::Option*>& options) {
  ordered_json out = ordered_json::object();
  for (const CLI::Option* option : options) out[field_of(*option)] = value_of(*option);
  return out;
}

std::string AppliedSettings::with_source(const std::string& message) const {
  for (const std::string& name : names)
    if (message.starts_with("--" + name + " ")) return where + message.substr(2);
  return message;
}

AppliedSettings apply_settings(const std::vector<CLI::Option*>& options, const ordered_json& fields,
                               const std::string& where) {
  std::vector<std::string> known;
  known.reserve(options.size());
  for (const CLI::Option* option : options) known.push_back(field_of(*option));
  for (const auto& [name, value] : fields.items())
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      const std::string near = nearest(name, known);
      std::string all;
      for (const std::string& each : known) all += (all.empty() ? "" : ", ") + each;
      throw UsageError(where + name + ": no such setting" + (near.empty() ? "" : "; did you mean " + near + "?") +
                       "; there are " + all);
    }
  AppliedSettings out{where, {}};
  for (CLI::Option* option : options) {
    const std::string name = field_of(*option), at = where + name;
    const auto field = fields.find(name);
    if (field == fields.end() || field->is_null() || option->count() > 0) continue;
    if (is_flag(*option)) {
      if (!field->is_boolean()) wrong(at, "true or false", *field);
      if (!field->get<bool>()) continue;
    }
    try {
      option->add_result(is_flag(*option) ? "true" : text_of(*field, at));
      option->run_callback();
    } catch (const CLI::Error& e) {
      throw UsageError(at + " is " + short_text(*field) + ": " + e.what());
    }
    out.names.push_back(name);
  }
  return out;
}

namespace {

// What the command line decides with another option is not taken from a file, either. A record also holds what followed
// from such an option in its fit.
void leave_out_decided(const std::vector<CLI::Option*>& options, ordered_json& settings, bool is_record) {
  const auto is_given = [&](const std::string& name) {
    return std::any_of(options.begin(), options.end(),
                       [&](const CLI::Option* option) { return option->count() > 0 && field_of(*option) == name; });
  };
  std::vector<const char*> decided;
  if (is_given("scene") || is_given("object")) decided = {"scene", "object"};
  if (is_record && !decided.empty())
    decided.insert(decided.end(), {"steps", "sh", "background", "center", "scale", "auto-frame"});
  if (is_record && is_given("start")) decided.insert(decided.end(), {"model", "view-count", "crop"});
  if (is_given("quality")) decided.insert(decided.end(), {"steps", "size"});
  for (const char* name : decided)
    if (const auto field = settings.find(name); field != settings.end()) *field = nullptr;
}

}  // namespace

AppliedSettings apply_settings_file(const std::vector<CLI::Option*>& options, const std::string& path) {
  ordered_json file = parsed_file(path, "settings of a fit");
  if (!file.is_object()) throw UsageError(path + ": must be an object of settings (found " + short_text(file) + ")");
  const auto settings = file.find("settings");
  if (settings == file.end()) {
    leave_out_decided(options, file, false);
    return apply_settings(options, file, path + ": ");
  }
  if (!settings->is_object()) wrong(path + ": settings", "an object", *settings);
  for (const auto& [name, value] : file.items())
    if (std::find(std::begin(fit_record_fields), std::end(fit_record_fields), name) == std::end(fit_record_fields))
      throw UsageError(path + ": " + name + ": no such field beside \"settings\"");
  leave_out_decided(options, *settings, true);
  return apply_settings(options, *settings, path + ": settings.");
}

vsplat_fit_start start_of(const std::string& text) {
  return text == "auto"      ? VSPLAT_FIT_AUTO
         : text == "network" ? VSPLAT_FIT_NETWORK
         : text == "points"  ? VSPLAT_FIT_POINTS
         : text == "random"  ? VSPLAT_FIT_RANDOM
                             : VSPLAT_FIT_SCENE;
}

bool uses_network(const FitSettings& o) {
  const vsplat_fit_start start = start_of(o.start);
  return start == VSPLAT_FIT_NETWORK || (start == VSPLAT_FIT_AUTO && !o.scene);
}

void check(const FitSettings& o) {
  if (o.object && o.scene) throw UsageError("--object and --scene exclude each other");
  if (!uses_network(o)) {
    if (!o.model.empty()) throw UsageError("--model is for --start network");
    if (o.view_count) throw UsageError("--view-count is for --start network");
    if (o.placement.crop != "auto") throw UsageError("--crop is for --start network");
  }
}

vsplat::Scene start_scene(const std::string& path) {
  vsplat::Scene out = vsplat::Scene::load(path);
  if (out.info().surfels)
    throw UsageError(path + " holds surfels, but only Gaussians of three scales can be fitted: vsplat convert " +
                     "--surfels-to-gaussians makes them");
  if (out.info().count == 0) throw std::runtime_error(path + " has no Gaussian: there is nothing to fit");
  return out;
}

std::string start_file(const FitSettings& o) { return start_of(o.start) == VSPLAT_FIT_SCENE ? o.start : ""; }

FitInputs::FitInputs(const FitSettings& settings, FitJob& job) : settings_(settings), job_(job) {
  vsplat_fit_options& o = job.options;
  o.start = start_of(settings.start);
  set_placement(settings.placement, input_);
  input_.force = settings.force;
  input_.view_count = settings.view_count;
  o.input = &input_;
  if (!settings.near.empty()) o.near_plane = positive_number("--near", settings.near, "distance in world units");
  network_.near_plane = o.near_plane;
  o.extent = settings.object ? VSPLAT_EXTENT_OBJECT : settings.scene ? VSPLAT_EXTENT_SCENE : VSPLAT_EXTENT_AUTO;
  o.reconstruct = &network_;
  if (!settings.names.empty()) names_ = list("--views", settings.names);
  for (const std::string& name : names_) name_pointers_.push_back(name.c_str());
  o.names = name_pointers_.empty() ? nullptr : name_pointers_.data();
  o.num_names = name_pointers_.size();
}

void FitInputs::load() {
  if (job_.options.start == VSPLAT_FIT_SCENE) scene_ = start_scene(settings_.start);
  if (uses_network(settings_)) model_ = load_model(settings_.model);
  job_.options.scene = scene_.get();
  job_.options.model = model_.get();
}

namespace {

void add_scene_options(CLI::App& sub, FitOptions& o) {
  sub.add_option(
         "--quality", o.quality,
         "Number of steps (a quarter more for an object with 12 pictures or more) and pixels of the pictures' longer "
         "side: draft 2,000 and 512, normal 7,000 and 1,024, high 30,000 and 1,600 (default: draft)")
      ->check(one_of({"draft", "normal", "high"}))
      ->type_name("draft|normal|high");
  sub.add_option("--steps", o.steps,
                 "Number of steps (default: auto, by --quality; for an object with few views, the number that was "
                 "best for the views left out in turn)")
      ->type_name("N|auto");
  sub.add_option("--time", o.seconds, "Time limit, measuring included: no step is begun that would end after it")
      ->type_name("SECONDS");
  sub.add_option(
         "--holdout", o.holdout,
         "Which pictures are held out to judge the scene (default: auto, every eighth of 12 or more, of a whole "
         "scene of 5 or more; with fewer, each is left out in turn, or none for a whole scene)")
      ->type_name("auto|none|N|NAME,...");
  sub.add_option("--size", o.size, "Pixels of the pictures' longer side (default: by --quality)")->type_name("N|full");
  const char* what = "The scene";
  sub.add_option("--max-gaussians", o.max_gaussians,
                 "Number of Gaussians that it may grow to (default: by the pictures; with fewer than 12 pictures it "
                 "does not grow)")
      ->type_name("N")
      ->group(what);
  sub.add_option("--strategy", o.strategy,
                 "How it grows: mcmc adds Gaussians near opaque ones, error splits those that cover errors of the "
                 "pictures (default: mcmc)")
      ->check(one_of({"mcmc", "error"}))
      ->type_name("mcmc|error")
      ->group(what);
  sub.add_option("--consolidate", o.consolidate,
                 "Share of its Gaussians to keep for the last quarter of the steps, the most visible ones (default: "
                 "0.5 for an object with many views and without --max-gaussians, else 1)")
      ->type_name("SHARE")
      ->group(what);
  sub.add_option("--sh", o.sh, "Degree of its view-dependent colour (default: the start's, 3 with many views)")
      ->check(one_of({"0", "1", "2", "3"}))
      ->type_name("0..3")
      ->group(what);
  sub.add_option("--freeze", o.freeze,
                 "Parameters that are not changed: some of means, scales, rotations, opacities, sh (default: none)")
      ->type_name("NAME,...")
      ->group(what);
  sub.add_flag("--antialias", o.antialias,
               "Fit for drawing at any size: what is smaller than a pixel fades instead of growing. The file says so, "
               "and render obeys it")
      ->group(what);
  sub.add_option("--seed", o.seed,
                 "Seed of the pictures' order, of random backgrounds, of growth and of --start random (default: 0)")
      ->type_name("S")
      ->group(what);
}

}  // namespace

std::vector<CLI::Option*> add_fit_settings(CLI::App& app, FitSettings& o) {
  const std::size_t before = app.get_options().size();
  app.add_option(
         "--start", o.start,
         "What the fit begins with: a scene file (./NAME if it is called like one of these words), the network's "
         "scene (with --scene in its cube, with points around), COLMAP's points, or random points. Default: auto, for "
         "a whole scene its points, for an object the network's scene with fewer than 12 pictures, else its points; "
         "random points if there are none")
      ->type_name("SCENE|network|points|random|auto");
  app.add_flag("--scene", o.scene,
               "Fit the whole scene that the pictures show (default, unless they have masks or alpha, or a cube is "
               "given)");
  app.add_flag("--object", o.object, "Fit an object: everything outside its cube is white");
  app.add_option("--views", o.names,
                 "Which pictures are used: names (stem or path) or @ and place in the list from 0 (default: all)")
      ->type_name("NAME,...|@INDEX,...");
  add_view_options(app, o.picture_folder, o.skip_bad);
  add_scene_options(app, o.fit);
  app.add_option("-m,--model", o.model, "The model of --start network (default: the built-in model)")
      ->type_name("MODEL");
  app.add_option("--near", o.near,
                 "Near plane, world units (default: the start's; for an object 0.2 times its cube's edge, for a whole "
                 "scene a hundredth of the distance to its nearest points)")
      ->type_name("Z");
  app.add_option("--view-count", o.view_count,
                 "Number of well-spread fitted pictures that --start network gives the network, 1 to 16 (default: what "
                 "the model's authors found best)")
      ->check(CLI::Range(1, 16).description(""))
      ->type_name("N");
  add_placement_options(app, o.placement);
  app.add_flag("--force", o.force, "Continue even if the cube seems to be behind or outside most views")
      ->group(placement_group);
  const char* behind = "Background and masks";
  app.add_option("--background", o.fit.background,
                 "What is behind the scene while fitting and measuring: a colour as in `render`; random, a new colour "
                 "in every step, which leaves no holes (measured over black); or sky, which is fitted with the scene "
                 "and written as Gaussians on a far sphere (default: auto, sky for a whole scene; for an object white, "
                 "with a random colour in every other step if its pictures have masks)")
      ->type_name("COLOUR|random|sky|auto")
      ->group(behind);
  app.add_option("--masks", o.fit.masks,
                 "What masks mark: object, the object, with nothing outside it (default); ignore, what is fitted and "
                 "measured, while the rest, such as people walking past, is ignored. Alpha always marks the object")
      ->check(one_of({"object", "ignore"}))
      ->type_name("object|ignore")
      ->group(behind);
  app.add_flag("--invert-masks", o.fit.invert_masks, "Masks are black inside, not white")->group(behind);
  const char* depth = "Depth";
  app.add_option(
         "--depth", o.fit.depth,
         "Depths that are compared with the drawn ones: metric, distances in the depth pictures that the list names "
         "(depth_file_path); relative, those but for a scale and a shift of each picture; inverse, the same of 1 / "
         "distance, as networks for single pictures make them; points, of the COLMAP points that a picture sees "
         "(default: none)")
      ->check(one_of({"none", "metric", "relative", "inverse", "points"}))
      ->type_name("none|metric|relative|inverse|points")
      ->group(depth);
  app.add_option("--depth-weight", o.fit.depth_weight, "Weight of the depths' loss beside the colours' (default: 0.1)")
      ->type_name("W")
      ->group(depth);
  app.add_flag("--poses", o.fit.poses,
               "Also correct the cameras slightly, and write them beside the scene in the format of cameras.json: "
               "SCENE.poses.json")
      ->group(beside_scene);
  app.add_flag(
         "--exposure", o.fit.exposure,
         "Fit an affine map of colours for each picture, to compensate for different exposures; the maps are not kept")
      ->group(beside_scene);
  std::vector<CLI::Option*> all = app.get_options();
  return {all.begin() + static_cast<std::ptrdiff_t>(before), all.end()};
}

}  // namespace command

// vsplat evaluate --scenes: scenes, ready or fitted here, on held-out photographs of several sets.
#include "evaluate_scenes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>

#include "arguments.h"
#include "fit_settings.h"
#include "naming.h"
#include "outputs.h"
#include "request_fields.h"
#include "scene_file.h"
#include "session.h"
#include "table_text.h"

namespace command {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::size_t every = 8;  // one in so many is held out
// What the set says, or the protocol, so that `fit` may not.
constexpr const char* of_the_set[] = {"views", "holdout", "size", "pictures", "skip-bad", "masks", "invert-masks"};

using Colour = std::array<float, 3>;

// A set of photographs with its scene, as listed.
struct SceneSet {
  std::string name, views, pictures, test, scene, output;
  std::string size;  // "full" or a number of pixels
  int longest = 512;
  std::optional<Colour> background;  // none: what the scene's fit was measured over, else white
  vsplat_masks masks = VSPLAT_MASKS_OBJECT;
  bool invert_masks = false;
  CLI::App app;  // holds the options of the fit
  FitSettings settings;
  std::vector<CLI::Option*> options;
  std::unique_ptr<FitJob> job;  // null: the scene is ready
  std::optional<SceneFile> file;
};

using Sets = std::vector<std::unique_ptr<SceneSet>>;

void read_size(Fields& fields, SceneSet& set, const ordered_json* size) {
  if (!size) {
    set.size = std::to_string(set.longest);
  } else if (*size == "full") {
    set.size = "full", set.longest = 0;
  } else if (size->is_number_unsigned() && size->get<std::uint64_t>() >= 16 && size->get<std::uint64_t>() <= 65535) {
    set.longest = size->get<int>(), set.size = std::to_string(set.longest);
  } else {
    Fields::wrong(fields.path_of("size"), "\"full\" or a whole number of pixels from 16 to 65535", *size);
  }
}

void read_masks(Fields& fields, SceneSet& set) {
  if (fields.one_of_two("masks", "object", "ignore") == "ignore") set.masks = VSPLAT_MASKS_IGNORE;
  const ordered_json* inverted = fields.any("invert-masks");
  if (inverted && !inverted->is_boolean()) Fields::wrong(fields.path_of("invert-masks"), "true or false", *inverted);
  set.invert_masks = inverted && inverted->get<bool>();
}

// Paths in the settings of a fit are relative to the list, too.
void read_fit(Fields& fields, SceneSet& set, const fs::path& folder) {
  const ordered_json* given = fields.object("fit");
  std::vector<CLI::Option*> allowed;
  for (CLI::Option* option : set.options)
    if (std::find(std::begin(of_the_set), std::end(of_the_set), option->get_lnames().front()) == std::end(of_the_set))
      allowed.push_back(option);
  ordered_json placed = given ? *given : ordered_json::object();
  for (const char* name : {"start", "model"}) {
    const auto field = placed.find(name);
    if (field == placed.end() || !field->is_string()) continue;
    const std::string text = field->get<std::string>();
    if (text.empty()) continue;
    if (name != std::string("start") || start_of(text) == VSPLAT_FIT_SCENE) *field = (folder / text).string();
  }
  const AppliedSettings applied = apply_settings(allowed, placed, fields.path_of("fit") + ".");
  FitSettings& s = set.settings;
  ordered_json of_protocol = {{"size", set.size},
                              {"holdout", "none"},
                              {"masks", set.masks == VSPLAT_MASKS_IGNORE ? "ignore" : "object"},
                              {"invert-masks", set.invert_masks}};
  if (!set.pictures.empty()) of_protocol["pictures"] = set.pictures;
  apply_settings(set.options, of_protocol, "");
  if (!set.output.empty()) {
    need_scene_ending(fields.path_of("output"), set.output);
    s.fit.record = fs::path(set.output).replace_extension(".fit.json").string();
    s.fit.page = fs::path(set.output).replace_extension(".fit.html").string();
  }
  applied.naming([&] {
    check(s);
    set.job = std::make_unique<FitJob>(s.fit);
    const FitInputs checked(s, *set.job);  // fitted_scene() makes them again, for the views that are not held out
  });
  set.job->from = set.views;
}

Sets read_list(const std::string& path) {
  const ordered_json file = parsed_file(path, "a list of sets to measure");
  const fs::path folder = fs::path(path).parent_path();
  Sets out;
  std::set<std::string> names;
  Fields::objects_of(file, path + ": ", folder, [&](Fields& fields) {
    auto set = std::make_unique<SceneSet>();
    set->options = add_fit_settings(set->app, set->settings);
    set->name = fields.text("name");
    if (!names.insert(set->name).second)
      throw std::runtime_error(fields.path_of("name") + " is " + set->name + ", as another set's");
    set->views = (folder / fields.text("views")).string();
    set->pictures = fields.path("pictures");
    set->test = fields.path("test");
    set->scene = fields.path("scene");
    set->output = fields.path("output");
    read_size(fields, *set, fields.any("size"));
    if (const std::string given = fields.text("background", ""); !given.empty())
      set->background = colour(fields.path_of("background"), given);
    read_masks(fields, *set);
    if (set->scene.empty())
      read_fit(fields, *set, folder);
    else if (fields.object("fit") || !set->output.empty())
      throw std::runtime_error(fields.path_of("scene") + " is a ready scene: fit and output are for sets without one");
    out.push_back(std::move(set));
  });
  return out;
}

// The protocol: the held-out views by index, and the others.
struct Split {
  std::vector<std::int32_t> held_out, fitted;
};

Split split_of(const SceneSet& set, const vsplat::Views& views) {
  std::vector<std::pair<std::string, std::int32_t>> all;
  for (std::size_t i = 0; i < views.size(); ++i) all.emplace_back(views.name(i), static_cast<std::int32_t>(i));
  Split out;
  if (set.test.empty()) std::sort(all.begin(), all.end());
  for (std::size_t i = 0; i < all.size(); ++i)
    (set.test.empty() && i % every == 0 ? out.held_out : out.fitted).push_back(all[i].second);
  if (out.fitted.empty()) throw std::runtime_error(set.views + ": one view alone: none is left to fit to");
  return out;
}

vsplat::Views load_views(const std::string& path, const std::string& pictures, Outputs* outputs) {
  vsplat::Views out = vsplat::Views::load(path, views_options(pictures, false, false));
  if (outputs)
    for (const std::string& file : out.files()) outputs->input(file);
  return out;
}

struct SceneRow {
  std::string name, error;
  int width = 0, height = 0;
  std::size_t pictures = 0;
  vsplat_measured mean = VSPLAT_MEASURED_INIT;
  std::uint64_t gaussians = 0;
  double steps, seconds, peak;     // NaN: unknown
  std::optional<Colour> fit_over;  // what the fit's pictures were measured over

  SceneRow() : steps(std::nan("")), seconds(steps), peak(steps) {}
};

Colour colour_in(const ordered_json& value, const std::string& where) {
  Colour out{};
  bool good = value.is_array() && value.size() == out.size();
  for (std::size_t i = 0; good && i < out.size(); ++i) {
    good = value[i].is_number() && value[i].get<double>() >= 0 && value[i].get<double>() <= 1;
    if (good) out[i] = value[i].get<float>();
  }
  if (!good) Fields::wrong(where, "a list of three numbers from 0 to 1", value);
  return out;
}

// What a fit has recorded beside its scene, if it is this scene's record.
void read_record(const std::string& scene, SceneRow& row) {
  const std::string path = fs::path(scene).replace_extension(".fit.json").string();
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return;
  constexpr double most = 1e15;
  try {
    const ordered_json record = parsed_file(path, "the record of a fit");
    Fields file(record, path + ": ", {});
    const ordered_json *counts = file.object("counts"), *figures = file.object("figures");
    if (!counts || !figures) return;
    if (Fields(*counts, file.path_of("counts"), {}).count("gaussians", 0, UINT64_MAX, 0) != row.gaussians) return;
    Fields of_fit(*figures, file.path_of("figures"), {});
    SceneRow read = row;
    read.steps = of_fit.number("steps", 0, most, row.steps);
    read.seconds = of_fit.number("seconds", 0, most, row.seconds);
    read.peak = of_fit.number("peak_bytes", 0, most, row.peak);
    if (const ordered_json* over = of_fit.any("background"))
      read.fit_over = colour_in(*over, of_fit.path_of("background"));
    row = read;
  } catch (const std::runtime_error& e) {
    warn(std::string(e.what()) + "; steps, seconds and memory of this fit are left out");
  }
}

vsplat::Scene fitted_scene(SceneSet& set, const Split& split, const vsplat::Views& views, Session& session,
                           const Common& common, Outputs& outputs, SceneRow& row) {
  ordered_json fitted = ordered_json::array();
  for (const std::int32_t view : split.fitted) fitted.push_back("@" + std::to_string(view));
  apply_settings(set.options, {{"views", fitted}}, "");
  set.job->given_settings = settings_in(set.options);
  FitInputs inputs(set.settings, *set.job);
  for (const std::string& path : {start_file(set.settings), set.settings.model}) outputs.input(path);
  inputs.load();
  const auto keep = [&](const vsplat::Scene& scene) {
    if (interrupted()) throw vsplat::Error(VSPLAT_ERROR_CANCELLED, "interrupted");
    if (!set.file) return;
    set.file->save(common, scene);
    outputs.keep();
  };
  vsplat::Scene out = set.job->run(session, common, views, outputs, {}, keep);
  row.steps = static_cast<double>(set.job->result().steps);
  row.seconds = set.job->result().seconds;
  row.peak = static_cast<double>(set.job->result().peak);
  Colour& over = row.fit_over.emplace();
  std::copy_n(set.job->result().background, over.size(), over.begin());
  return out;
}

SceneRow measured(SceneSet& set, Session& session, const Common& common, const ScenesOptions& o, Outputs& outputs) {
  SceneRow row;
  row.name = set.name;
  if (set.job) set.job->since = elapsed_seconds();
  const vsplat::Views views = load_views(set.views, set.pictures, &outputs);
  const vsplat::Views test = set.test.empty() ? views : load_views(set.test, set.pictures, &outputs);
  const Split split = split_of(set, views);
  vsplat::Scene scene;
  if (set.job) {
    scene = fitted_scene(set, split, views, session, common, outputs, row);
  } else {
    outputs.input(set.scene);
    scene = vsplat::Scene::load(set.scene);
  }
  row.gaussians = scene.info().count;
  if (!set.job) read_record(set.scene, row);
  vsplat_measure_options how = VSPLAT_MEASURE_OPTIONS_INIT;
  if (set.test.empty()) how.views = split.held_out.data(), how.num_views = split.held_out.size();
  how.longest = set.longest;
  how.masks = set.masks;
  how.invert_masks = set.invert_masks;
  const Colour over = set.background.value_or(row.fit_over.value_or(Colour{1, 1, 1}));
  std::copy(over.begin(), over.end(), how.background);
  how.lpips = o.lpips.empty() ? nullptr : o.lpips.c_str();
  row.mean = naming({set.test.empty() ? set.views : set.test}, {set.scene, o.lpips}, [&] {
    return vsplat::measure(session.device(), scene, test, how, [&](const vsplat_measured& picture) {
      row.width = std::max(row.width, picture.width), row.height = std::max(row.height, picture.height);
      ++row.pictures;
      show_progress(common, set.name + ": " + std::to_string(row.pictures) + " pictures compared");
      return !interrupted();
    });
  });
  return row;
}

struct SceneColumn {
  const char *name, *heading;
  double (*value)(const SceneRow&);
  int digits;
  bool is_score;  // has a mean
};

constexpr SceneColumn scene_columns[] = {
    {"pictures", "pictures", [](const SceneRow& r) { return static_cast<double>(r.pictures); }, 0, false},
    {"psnr", "PSNR", [](const SceneRow& r) { return r.mean.psnr; }, 2, true},
    {"psnr_cc", "psnr_cc", [](const SceneRow& r) { return r.mean.psnr_cc; }, 2, true},
    {"ssim", "SSIM", [](const SceneRow& r) { return r.mean.ssim; }, 4, true},
    {"lpips_alex", "LPIPS alex", [](const SceneRow& r) { return r.mean.lpips_alex; }, 4, true},
    {"lpips_vgg", "LPIPS vgg", [](const SceneRow& r) { return r.mean.lpips_vgg; }, 4, true},
    {"gaussians", "Gaussians", [](const SceneRow& r) { return static_cast<double>(r.gaussians); }, 0, false},
    {"steps", "steps", [](const SceneRow& r) { return r.steps; }, 0, false},
    {"seconds", "seconds", [](const SceneRow& r) { return r.seconds; }, 1, false},
    {"peak_mib", "peak MiB", [](const SceneRow& r) { return r.peak / (1 << 20); }, 0, false},
};

class ScenesTable {
 public:
  void add(SceneRow row) { rows_.push_back(std::move(row)); }
  std::size_t size() const { return rows_.size(); }
  std::size_t failed() const {
    return static_cast<std::size_t>(
        std::count_if(rows_.begin(), rows_.end(), [](const SceneRow& row) { return !row.error.empty(); }));
  }

  TableLines lines() const {
    const std::vector<SceneColumn> shown = columns_shown();
    TableLines out{{"name", "size"}, {"set", "size"}, 2, {}};
    for (const SceneColumn& column : shown)
      out.names.emplace_back(column.name), out.headings.emplace_back(column.heading);
    for (const SceneRow& row : rows_) {
      out.rows.push_back({row.name, row.error.empty() ? size_of(row) : "failed"});
      for (const SceneColumn& column : shown) out.rows.back().push_back(text_of(row, column));
    }
    if (rows_.size() - failed() < 2) return out;
    out.rows.push_back({"mean of " + std::to_string(rows_.size() - failed()), ""});
    for (const SceneColumn& column : shown)
      out.rows.back().push_back(column.is_score ? fixed(mean(column), column) : "");
    return out;
  }

  ordered_json to_json() const {
    const std::vector<SceneColumn> shown = columns_shown();
    ordered_json rows = ordered_json::array(), means = ordered_json::object();
    for (const SceneRow& row : rows_) {
      ordered_json out = {{"name", row.name}};
      if (!row.error.empty()) {
        out["error"] = row.error;
      } else {
        out["size"] = {row.width, row.height};
        for (const SceneColumn& column : shown) out[column.name] = number(column.value(row), column);
      }
      rows.push_back(std::move(out));
    }
    for (const SceneColumn& column : shown)
      if (column.is_score && failed() < rows_.size()) means[column.name] = number(mean(column), column);
    return {{"sets", rows}, {"mean", means}};
  }

 private:
  // LPIPS only if there are weights.
  std::vector<SceneColumn> columns_shown() const {
    std::vector<SceneColumn> out;
    for (const SceneColumn& column : scene_columns)
      if (!std::string(column.name).starts_with("lpips") ||
          std::any_of(rows_.begin(), rows_.end(),
                      [&](const SceneRow& row) { return row.error.empty() && !std::isnan(column.value(row)); }))
        out.push_back(column);
    return out;
  }
  double mean(const SceneColumn& column) const {
    double sum = 0;
    for (const SceneRow& row : rows_)
      if (row.error.empty()) sum += column.value(row);
    return sum / static_cast<double>(rows_.size() - failed());
  }
  static std::string size_of(const SceneRow& row) {
    return std::to_string(row.width) + " x " + std::to_string(row.height);
  }
  static ordered_json number(double value, const SceneColumn& column) {
    if (!std::isfinite(value)) return {};
    return column.digits == 0 ? ordered_json(std::llround(value)) : ordered_json(value);
  }
  static std::string fixed(double value, const SceneColumn& column) {
    if (std::isnan(value)) return "-";
    char text[64];
    std::snprintf(text, sizeof text, "%.*f", column.digits, value);
    return text;
  }
  static std::string text_of(const SceneRow& row, const SceneColumn& column) {
    return row.error.empty() ? fixed(column.value(row), column) : "-";
  }

  std::vector<SceneRow> rows_;
};

void print(const Common& common, const ScenesTable& table) {
  clear_progress();
  if (common.json)
    print_json(table.to_json());
  else
    std::fputs(for_terminal(markdown(table.lines())).c_str(), stdout);
}

// The sets with their views, of which none is decoded.
void list_sets(const Common& common, const Sets& sets) {
  ordered_json out = ordered_json::array();
  for (const auto& set : sets) {
    const vsplat::Views views = load_views(set->views, set->pictures, nullptr);
    const Split split = split_of(*set, views);
    std::vector<std::string> held_out;
    for (const std::int32_t view : split.held_out) held_out.push_back(views.name(static_cast<std::size_t>(view)));
    if (!set->test.empty()) {
      const vsplat::Views test = load_views(set->test, set->pictures, nullptr);
      for (std::size_t i = 0; i < test.size(); ++i) held_out.push_back(test.name(i));
    }
    if (!common.json)
      std::printf("%s: %zu views to fit, %zu held out, size %s, %s\n", for_terminal(set->name).c_str(),
                  split.fitted.size(), held_out.size(), set->size.c_str(),
                  set->job ? "is fitted" : for_terminal(set->scene).c_str());
    out.push_back({{"name", set->name},
                   {"fitted", split.fitted.size()},
                   {"held_out", held_out},
                   {"size", set->size},
                   {"scene", set->job ? ordered_json() : ordered_json(set->scene)}});
  }
  if (common.json) print_json(out);
}

}  // namespace

void evaluate_scenes(const Common& common, const ScenesOptions& o) {
  for (const std::string& path : o.outputs) need_table_ending(path);
  set_up_library(common);
  const Sets sets = read_list(o.file);
  if (o.dry_run) {
    refuse_profile_of_dry_run(common);
    if (!o.outputs.empty()) throw UsageError("--dry-run measures nothing: there is no table to be written to --output");
    return list_sets(common, sets);
  }
  Outputs outputs(common.overwrite);
  outputs.input(o.file);
  for (const auto& set : sets) {
    if (set->output.empty()) continue;
    set->file.emplace(outputs, set->output);
    set->job->expect(outputs, set->output);
  }
  for (const std::string& path : o.outputs) outputs.expect(path);
  for (const std::string& path : {common.profile, common.trace}) outputs.expect(path);
  Session session(common);
  session.about("command", "evaluate");
  session.about("scenes", o.file);
  ScenesTable table;
  for (const auto& set : sets) {
    say(common, set->name);
    try {
      table.add(measured(*set, session, common, o, outputs));
    } catch (const std::exception& e) {
      if (interrupted()) {
        if (table.size() > 0) print(common, table);
        throw std::runtime_error("interrupted after " + std::to_string(table.size()) + " of " +
                                 std::to_string(sets.size()) + " sets");
      }
      outputs.drop();
      warn(set->name + " is left out: " + e.what());
      SceneRow row;
      row.name = set->name, row.error = e.what();
      table.add(std::move(row));
    }
  }
  for (const std::string& path : o.outputs)
    write_text(outputs.begin(path), table_file(path, table.lines(), table.to_json()));
  session.write_profile(outputs);
  outputs.commit();
  print(common, table);
  if (table.failed() > 0)
    throw std::runtime_error(std::to_string(table.failed()) + " of " + std::to_string(sets.size()) + " sets failed");
  say(common,
      std::to_string(sets.size()) + (sets.size() == 1 ? " set, " : " sets, ") + seconds_text(elapsed_seconds()));
}

}  // namespace command

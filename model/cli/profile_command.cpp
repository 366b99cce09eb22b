// vsplat profile diff: compares two profiles written by --profile.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "arguments.h"
#include "command.h"

namespace command {
namespace {

using nlohmann::json;

constexpr std::uintmax_t kLargestProfile = std::uintmax_t{256} << 20;  // bytes
constexpr double kSmallShare = 0.01;  // of the first profile's wall time: smaller stages differ by chance
constexpr std::size_t kKernels = 12;  // rows shown, those that differ most

struct DiffOptions {
  Common common;
  std::string before, after, fail_above;
};

struct Change {
  std::string name;
  double before = 0, after = 0;  // seconds
};

struct ReadProfile {
  std::string device, driver, model;
  double wall = 0;
  std::vector<std::pair<std::string, double>> parts, stages;      // seconds
  std::map<std::pair<std::string, std::string>, double> kernels;  // by stage and name
};

[[noreturn]] void refuse_profile(const std::string& path, const std::string& what) {
  throw std::runtime_error(path + ": is not a profile as --profile FILE.json writes it: " + what);
}

double profile_seconds(const std::string& path, const json& of, const char* field, double unit = 1) {
  if (!of.is_object() || !of.contains(field) || !of[field].is_number() || !(of[field].get<double>() >= 0))
    refuse_profile(path, std::string(field) + " is no number of 0 or more");
  return of[field].get<double>() * unit;
}

std::string profile_text_in(const std::string& path, const json& of, const char* field) {
  if (!of.is_object() || !of.contains(field) || !of[field].is_string())
    refuse_profile(path, std::string(field) + " is no text");
  return of[field].get<std::string>();
}

const json& profile_list(const std::string& path, const json& of, const char* field) {
  if (!of.contains(field) || !of[field].is_array()) refuse_profile(path, std::string(field) + " is no list");
  return of[field];
}

json parsed_profile(const std::string& path) {
  std::error_code problem;
  const auto size = std::filesystem::file_size(path, problem);
  if (problem) throw std::runtime_error(path + ": cannot be read: " + problem.message());
  if (size > kLargestProfile)
    throw std::runtime_error(path + ": has " + std::to_string(size) + " bytes; at most " +
                             std::to_string(kLargestProfile) + " are expected of a profile");
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  if (!file) throw std::runtime_error(path + ": cannot be read");
  const json out = json::parse(text.str(), nullptr, false);
  if (out.is_discarded() || !out.is_object()) refuse_profile(path, "it is no JSON object");
  return out;
}

ReadProfile profile_in(const std::string& path) {
  const json file = parsed_profile(path);
  ReadProfile out;
  out.device = profile_text_in(path, file, "device");
  out.driver = profile_text_in(path, file, "driver");
  if (file.contains("run") && file["run"].is_object() && file["run"].contains("model"))
    out.model = profile_text_in(path, file["run"], "model");
  out.wall = profile_seconds(path, file, "wall_s");
  if (!file.contains("wall") || !file["wall"].is_object())
    refuse_profile(path, "wall is no object (older versions do not write it)");
  for (const char* part : {"device", "compile", "upload", "file", "wait", "host", "other"})
    out.parts.emplace_back(part, profile_seconds(path, file["wall"], (std::string(part) + "_s").c_str()));
  for (const json& stage : profile_list(path, file, "stages")) {
    const std::string name = profile_text_in(path, stage, "stage");
    out.stages.emplace_back(name.empty() ? "outside of stages" : name, profile_seconds(path, stage, "wall_s"));
  }
  for (const json& kernel : profile_list(path, file, "kernels"))
    out.kernels[{profile_text_in(path, kernel, "stage"), profile_text_in(path, kernel, "name")}] +=
        profile_seconds(path, kernel, "total_ns", 1e-9);
  return out;
}

// The names of either profile, in the second one's order, with the time of each.
std::vector<Change> set_side_by_side(const std::vector<std::pair<std::string, double>>& before,
                                     const std::vector<std::pair<std::string, double>>& after) {
  std::vector<Change> out;
  const auto row = [&](const std::string& name) -> Change& {
    for (Change& there : out)
      if (there.name == name) return there;
    return out.emplace_back(Change{name});
  };
  for (const auto& [name, seconds] : after) row(name).after += seconds;
  for (const auto& [name, seconds] : before) row(name).before += seconds;
  return out;
}

std::vector<Change> kernels_side_by_side(const ReadProfile& before, const ReadProfile& after) {
  std::map<std::pair<std::string, std::string>, Change> rows;
  const auto named = [&](const auto& key) -> Change& {
    Change& out = rows[key];
    out.name = key.second + (key.first.empty() ? "" : " (" + key.first + ")");
    return out;
  };
  for (const auto& [key, seconds] : before.kernels) named(key).before = seconds;
  for (const auto& [key, seconds] : after.kernels) named(key).after = seconds;
  std::vector<Change> out;
  out.reserve(rows.size());
  for (const auto& [key, row] : rows) out.push_back(row);
  std::stable_sort(out.begin(), out.end(), [](const Change& a, const Change& b) {
    return std::abs(a.after - a.before) > std::abs(b.after - b.before);
  });
  return out;
}

// 0.05 if it takes a twentieth longer; infinite if it took no time before.
double slower_by(const Change& row) {
  if (row.before > 0) return row.after / row.before - 1;
  return row.after > 0 ? HUGE_VAL : 0;
}

std::string change_text(const Change& row) {
  const double by = slower_by(row);
  char text[32];
  std::snprintf(text, sizeof text, "%+.1f %%", 100 * by);
  return std::isfinite(by) ? text : "new";
}

json changes_json(const std::vector<Change>& rows) {
  json out = json::array();
  for (const Change& row : rows) {
    const double by = slower_by(row);
    out.push_back({{"name", row.name},
                   {"before_s", row.before},
                   {"after_s", row.after},
                   {"slower_by", std::isfinite(by) ? json(by) : json(nullptr)}});
  }
  return out;
}

void print_changes(const char* title, const std::vector<Change>& rows, std::size_t most = SIZE_MAX) {
  std::printf("%-40s %10s %10s %10s\n", title, "before", "after", "change");
  for (std::size_t i = 0; i < std::min(most, rows.size()); ++i) {
    const Change& row = rows[i];
    if (row.before == 0 && row.after == 0) continue;
    std::printf("%-40s %8.3f s %8.3f s %10s\n", for_terminal(row.name).c_str(), row.before, row.after,
                change_text(row).c_str());
  }
}

void diff(const DiffOptions& o) {
  const double limit = o.fail_above.empty() ? HUGE_VAL : percentage("--fail-above", o.fail_above);
  const ReadProfile before = profile_in(o.before), after = profile_in(o.after);
  const auto tell = [&](const char* what, const std::string& a, const std::string& b) {
    if (a != b) warn(std::string("the ") + what + "s differ: " + a + " and " + b);
  };
  tell("device", before.device, after.device);
  tell("driver", before.driver, after.driver);
  tell("model", before.model, after.model);
  const Change wall{"wall", before.wall, after.wall};
  const std::vector<Change> parts = set_side_by_side(before.parts, after.parts),
                            stages = set_side_by_side(before.stages, after.stages),
                            kernels = kernels_side_by_side(before, after);
  std::vector<Change> slower;
  if (slower_by(wall) > limit) slower.push_back(wall);
  for (const Change& stage : stages)
    if (slower_by(stage) > limit && std::max(stage.before, stage.after) >= kSmallShare * before.wall)
      slower.push_back(stage);
  if (o.common.json) {
    nlohmann::ordered_json out = {{"wall", changes_json({wall})[0]},
                                  {"parts", changes_json(parts)},
                                  {"stages", changes_json(stages)},
                                  {"kernels", changes_json(kernels)},
                                  {"slower", changes_json(slower)}};
    print_json(out);
  } else {
    print_changes("", {wall});
    print_changes("\nwhere the wall went", parts);
    print_changes("\nstages", stages);
    print_changes("\nkernels that differ most", kernels, kKernels);
  }
  if (slower.empty()) return;
  std::string text = "slower by more than " + o.fail_above + ":";
  for (const Change& row : slower) text += (&row == slower.data() ? " " : ", ") + row.name + " " + change_text(row);
  throw std::runtime_error(text);
}

}  // namespace

void add_profile(CLI::App& app, Run& run) {
  CLI::App* parent = app.add_subcommand("profile", "Compare profiles of runs");
  parent->require_subcommand(1);
  parent->footer("Example:\n  vsplat profile diff before.json after.json --fail-above 5%");
  auto o = std::make_shared<DiffOptions>();
  CLI::App* sub = parent->add_subcommand("diff", "Show what has become slower or faster from one profile to another");
  sub->add_option("before", o->before, "A profile that --profile wrote")->required()->type_name("BEFORE.json");
  sub->add_option("after", o->after, "The profile to compare with it")->required()->type_name("AFTER.json");
  sub->add_option("--fail-above", o->fail_above,
                  "Exit with 1 if the wall time or a stage is slower by more than this; stages under 1 % of the wall "
                  "time are ignored")
      ->type_name("P%");
  add_common(*sub, o->common, {.device = false, .profile = false, .overwrite = false, .outside = false});
  sub->footer(
      "Examples:\n"
      "  vsplat reconstruct photos/ --output scene.ply --profile before.json\n"
      "  vsplat profile diff before.json after.json --fail-above 5%\n"
      "Compare first runs with first runs and later ones with later ones: a device's first run also compiles.");
  sub->callback([o, &run] { run = [o] { diff(*o); }; });
}

}  // namespace command

// vsplat dataset info: the contents of a data set.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "command.h"
#include "outputs.h"

namespace command {
namespace {

using nlohmann::ordered_json;

constexpr int cell = 256, most_cells = 400, most_views = 8;

struct DatasetInfoOptions {
  Common common;
  std::vector<std::string> paths;
  std::string sheet;
  bool check = false;
};

struct Surveyed {
  ordered_json about;  // name, layout, path
  vsplat_dataset_object numbers = VSPLAT_DATASET_OBJECT_INIT;
  std::vector<std::string> bad;
  bool usable = true;  // not bad as a whole
};

bool is_about_data(const vsplat::Error& e) {
  return e.status() == VSPLAT_ERROR_FILE || e.status() == VSPLAT_ERROR_FORMAT || e.status() == VSPLAT_ERROR_INPUT;
}

void go_on(const Common& common, const std::string& what) {
  if (interrupted()) throw std::runtime_error("stopped");
  show_progress(common, what);
}

std::string all_paths(const DatasetInfoOptions& o) {
  std::string out;
  for (const std::string& path : o.paths) out += (out.empty() ? "" : ", ") + path;
  return out;
}

std::vector<Surveyed> survey(const DatasetInfoOptions& o, const vsplat::DataSet& set) {
  std::vector<Surveyed> out(set.count());
  for (size_t i = 0; i < out.size(); ++i) {
    go_on(o.common, "object " + std::to_string(i + 1) + " of " + std::to_string(out.size()));
    Surveyed& object = out[i];
    object.about = ordered_json::parse(set.describe(i));
    try {
      std::string bad;
      object.numbers = set.survey(i, o.check ? -1 : 4, bad);
      for (const auto& what : ordered_json::parse(bad)) object.bad.push_back(what.get<std::string>());
    } catch (const vsplat::Error& e) {
      if (!is_about_data(e)) throw;
      object.usable = false;
      object.bad.push_back(e.what());
    }
  }
  clear_progress();
  return out;
}

// One picture of every object, or several if there are few objects.
void write_sheet(const DatasetInfoOptions& o, const vsplat::DataSet& set, const std::vector<Surveyed>& objects,
                 const std::string& path) {
  const int count = static_cast<int>(objects.size()), shown = std::min(count, most_cells);
  int most = 1;
  for (const Surveyed& object : objects) most = std::max(most, object.numbers.views);
  const int each = std::min(std::clamp(64 / shown, 1, most_views), most);
  vsplat_sheet_options options = VSPLAT_SHEET_OPTIONS_INIT;
  options.expected = shown * each;
  if (each > 1) options.columns = each * std::max(1, most_views / each);
  vsplat::Sheet sheet(options);
  int added = 0;
  for (int k = 0; k < shown; ++k) {
    const auto i = static_cast<size_t>(static_cast<long>(k) * count / shown);
    const vsplat_dataset_object& numbers = objects[i].numbers;
    go_on(o.common, "sheet: object " + std::to_string(k + 1) + " of " + std::to_string(shown));
    for (int v = 0; v < std::min(each, numbers.views); ++v) {
      vsplat::Picture picture;
      picture.width = picture.height = std::min({cell, numbers.min_width, numbers.min_height});
      picture.alpha.resize(static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height));  // unused
      try {
        picture.colour = set.picture(i, v * numbers.views / std::min(each, numbers.views), picture.width);
        sheet.add(picture, v == 0 ? std::string(objects[i].about["name"]) : "");
        ++added;
      } catch (const vsplat::Error& e) {
        if (!is_about_data(e)) throw;
        say(o.common, std::string("not on the sheet: ") + e.what());
      }
    }
  }
  clear_progress();
  if (added == 0) throw std::runtime_error(all_paths(o) + ": no picture can be shown, so there is no sheet");
  sheet.save(path);
}

std::string range(const char* format, double low, double high) {
  char a[32], b[32];
  std::snprintf(a, sizeof a, format, low);
  std::snprintf(b, sizeof b, format, high);
  const std::string from = a, to = b;
  return from == to ? from : from + " - " + to;
}

void print_table(const std::vector<Surveyed>& objects) {
  std::printf("%-7s  %5s  %-13s  %-11s  %-13s  %6s  %4s  %s\n", "layout", "views", "pixels", "fov", "distance", "alpha",
              "bad", "object");
  for (const Surveyed& object : objects) {
    const vsplat_dataset_object& n = object.numbers;
    const std::string layout = object.about["layout"], name = for_terminal(object.about["name"]);
    if (!object.usable) {
      std::printf("%-7s  %5s  %-13s  %-11s  %-13s  %6s  %4s  %s\n", layout.c_str(), "-", "-", "-", "-", "-", "all",
                  name.c_str());
      continue;
    }
    const std::string pixels =
        range("%.0f", n.min_width, n.max_width) + " x " + range("%.0f", n.min_height, n.max_height);
    std::printf("%-7s  %5d  %-13s  %-11s  %-13s  %5.1f%%  %4d  %s\n", layout.c_str(), n.views, pixels.c_str(),
                range("%.1f", n.min_fov, n.max_fov).c_str(), range("%.2f", n.min_distance, n.max_distance).c_str(),
                100 * n.coverage, n.bad, name.c_str());
  }
}

ordered_json json_of(const Surveyed& object) {
  ordered_json out = object.about;
  const vsplat_dataset_object& n = object.numbers;
  if (object.usable) {
    out["views"] = n.views;
    out["width"] = {n.min_width, n.max_width};
    out["height"] = {n.min_height, n.max_height};
    out["fov"] = {n.min_fov, n.max_fov};
    out["distance"] = {n.min_distance, n.max_distance};
    out["center"] = {n.center[0], n.center[1], n.center[2]};
    out["scale"] = n.scale;
    out["pictures"] = n.pictures;
    out["alpha"] = n.coverage;
  }
  out["bad"] = object.bad;
  return out;
}

void info(const DatasetInfoOptions& o) {
  set_up_library(o.common);
  need_ending("--sheet", o.sheet, ".png");
  Outputs outputs(o.common.overwrite);
  outputs.expect(o.sheet);
  outputs.input_data(o.paths);
  const vsplat::DataSet set(o.paths);
  const std::vector<Surveyed> objects = survey(o, set);
  if (!o.sheet.empty()) write_sheet(o, set, objects, outputs.begin(o.sheet));
  outputs.commit();

  long views = 0, bad = 0;
  std::string first;  // of what is bad
  const std::string where = all_paths(o);
  ordered_json list = ordered_json::array();
  for (const Surveyed& object : objects) {
    views += object.numbers.views;
    if (bad == 0 && !object.bad.empty()) first = object.bad.front();
    bad += static_cast<long>(object.bad.size());
    list.push_back(json_of(object));
  }
  if (o.common.json) {
    const ordered_json all = {{"objects", list}, {"views", views}, {"bad", bad}};
    print_json(all);
  } else {
    print_table(objects);
    std::printf("%s: %zu objects, %ld views\n", for_terminal(where).c_str(), objects.size(), views);
  }
  for (const Surveyed& object : objects)
    for (const std::string& what : object.bad) say(o.common, "bad: " + what);
  if (bad > 0)
    throw std::runtime_error(where + ": " + std::to_string(bad) +
                             " bad objects, views or pictures; the first: " + first);
}

}  // namespace

void add_info_action(CLI::App& parent, Run& run) {
  auto o = std::make_shared<DatasetInfoOptions>();
  CLI::App* sub = parent.add_subcommand("info", "Show what a data set holds");
  sub->add_option("data", o->paths, "Folders of objects, or HDF5 files")->required()->type_name("DIR...");
  sub->add_option("--sheet", o->sheet, "Write a contact sheet with pictures of the objects")->type_name("FILE.png");
  sub->add_flag("--check", o->check, "Decode every picture, not only four of each object");
  add_common(*sub, o->common, {.device = false, .profile = false});
  sub->footer(
      "An object is a folder with transforms.json, cameras.json or a COLMAP model, at most four levels down, or a\n"
      "group of an HDF5 file in LaRa's layout. fov: degrees across the picture; distance: of the cameras from the\n"
      "middle of the object's cube, in its edges; alpha: how much of the network's square is the object. Data that\n"
      "cannot be used are reported, and make the exit code 1.\n"
      "Examples:\n"
      "  vsplat dataset info set --sheet set.png\n"
      "  vsplat dataset info photos/vase gobjaverse.h5 --check --json");
  sub->callback([o, &run] { run = [o] { info(*o); }; });
}

}  // namespace command

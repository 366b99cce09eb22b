#include "reconstruct_list.h"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "flags.h"
#include "outputs.h"
#include "scene_file.h"
#include "session.h"

namespace command {
namespace {
namespace fs = std::filesystem;

struct Object {
  std::string views, output;
  // What became of it.
  std::optional<vsplat::Scene> scene = {};  // until it is written
  std::string error = {};
  uint64_t gaussians = 0;
  double seconds = 0;
};

// Of "photos/cup", "photos/cup/" and "photos/cup/transforms.json": cup.
std::string name_of(const std::string& views) {
  fs::path path = fs::absolute(views).lexically_normal();
  std::error_code error;
  if (!path.has_filename()) path = path.parent_path();
  if (fs::is_regular_file(path, error)) path = path.parent_path();
  return path.filename().string();
}

std::vector<Object> read_list(const ListRequest& request) {
  std::ifstream file;
  if (request.list != "-") {
    std::error_code error;
    file.open(request.list);
    if (!file || fs::is_directory(request.list, error))
      throw std::runtime_error(request.list + ": no list of views can be read there");
  }
  std::istream& in = request.list == "-" ? std::cin : file;
  std::vector<Object> out;
  std::map<std::string, int> lines;  // by name
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.find_first_not_of(" \t") == std::string::npos) continue;
    const std::size_t tab = line.find('\t');
    const std::string views = line.substr(0, tab);
    const std::string name = tab == std::string::npos ? name_of(views) : line.substr(tab + 1);
    const std::string where = request.list + ", line " + std::to_string(number) + ": ";
    if (name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos ||
        name.find('\t') != std::string::npos)
      throw UsageError(where + "the scene's name is \"" + name +
                       "\": a file's name without its ending is expected, after a tab behind the views");
    if (const auto [other, is_new] = lines.emplace(name, number); !is_new)
      throw UsageError(where + "its scene would be " + name + ".ply, as that of line " + std::to_string(other->second) +
                       ": give one of them another name, after a tab behind the views");
    out.push_back({views, (fs::path(request.output) / (name + ".ply")).string()});
  }
  if (out.empty()) throw UsageError(request.list + " lists no views");
  return out;
}

// What is another object's trouble, too, is not left for the end.
bool is_about_object(const vsplat::Error& e) {
  return e.status() == VSPLAT_ERROR_FILE || e.status() == VSPLAT_ERROR_FORMAT || e.status() == VSPLAT_ERROR_INPUT ||
         e.status() == VSPLAT_ERROR_USAGE;
}

void print_results(const Common& common, const std::vector<Object>& objects, std::size_t skipped) {
  if (!common.json) return;
  nlohmann::ordered_json out = {{"objects", nlohmann::ordered_json::array()}, {"skipped", skipped}};
  for (const Object& object : objects) {
    nlohmann::ordered_json row = {{"views", object.views}, {"output", object.output}};
    if (object.error.empty())
      row.update({{"gaussians", object.gaussians}, {"seconds", object.seconds}});
    else
      row["error"] = object.error;
    out["objects"].push_back(std::move(row));
  }
  out["seconds"] = elapsed_seconds();
  print_json(out);
}

}  // namespace

void reconstruct_list(const ListRequest& request) {
  const Common& common = request.common;
  std::vector<Object> objects = read_list(request);
  std::size_t skipped = 0;
  if (request.skip_existing) {
    std::error_code error;
    skipped = std::erase_if(objects, [&](const Object& o) { return fs::is_regular_file(o.output, error); });
  }
  Outputs outputs(common.overwrite);
  outputs.input(request.model);
  if (request.list != "-") outputs.input(request.list);
  std::vector<SceneFile> files;
  for (const Object& object : objects) files.emplace_back(outputs, object.output);
  for (const std::string& path : {common.profile, common.trace}) outputs.expect(path);

  Session session(common, Devices::several);
  const vsplat::Model model = load_model(request.model);
  vsplat_reconstruct_options run = request.run;
  run.progress = [](void*, const char*, double) -> int32_t { return interrupted() ? 0 : 1; };
  session.start("reconstructing");
  std::size_t failed = 0;
  const auto work = [&](const vsplat::Device& device, std::size_t i) {
    Object& object = objects[i];
    const double begun = elapsed_seconds();
    try {
      const vsplat::Views views = vsplat::Views::load(object.views, request.pictures);
      const vsplat::Input input(model, views, request.input);
      object.scene = vsplat::reconstruct(device, model, input, run);
    } catch (const vsplat::Error& e) {
      if (!is_about_object(e)) throw;
      object.error = with_flags(e.what());
    }
    object.seconds = elapsed_seconds() - begun;
  };
  const auto done = [&](std::size_t i) {
    Object& object = objects[i];
    const double share = static_cast<double>(i + 1) / static_cast<double>(objects.size());
    const std::string which =
        object.views + " (" + std::to_string(i + 1) + " of " + std::to_string(objects.size()) + ")";
    if (object.scene) {
      object.gaussians = object.scene->info().count;
      files[i].save(common, *object.scene);
      outputs.keep();
      object.scene.reset();
      if (common.verbose) say(common, object.output + ": " + std::to_string(object.gaussians) + " Gaussians");
    } else {
      ++failed;
      warn(object.views + " is left out: " + object.error);
    }
    if (!Session::on_progress(&session, which.c_str(), share)) throw vsplat::Error(VSPLAT_ERROR_CANCELLED, "stopped");
  };
  try {
    vsplat::share_out(session.devices(), objects.size(), work, done);
  } catch (const vsplat::Error& e) {
    if (e.status() == VSPLAT_ERROR_CANCELLED)
      throw std::runtime_error("interrupted: the scenes that were made are in " + request.output +
                               ", and --skip-existing goes on from there");
    throw;
  }
  session.write_profile(outputs);
  outputs.commit();
  const std::size_t made = objects.size() - failed;
  say(common, request.output + ": " + std::to_string(made) + (made == 1 ? " scene" : " scenes") +
                  (skipped ? ", " + std::to_string(skipped) + " were there" : "") + ", " +
                  seconds_text(elapsed_seconds()));
  print_results(common, objects, skipped);
  if (failed)
    throw std::runtime_error(std::to_string(failed) + " of " + std::to_string(objects.size()) +
                             " objects could not be reconstructed: see the warnings");
}

}  // namespace command

#include "reconstruct_list.h"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "outputs.h"
#include "scene_file.h"
#include "session.h"

namespace command {
namespace {
namespace fs = std::filesystem;

struct Object {
  std::string views, output;
  std::size_t place;  // index in the list
  // Result.
  std::optional<vsplat::Scene> scene = {};  // until it is written
  std::string error = {};
  uint64_t gaussians = 0;
  double seconds = 0;
  bool is_done = false;
};

// "cup" for "photos/cup", "photos/cup/" and "photos/cup/transforms.json".
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
  std::map<std::string, int> lines;  // line numbers by name
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
                       "\": a file's name without its ending is expected, after the views and a tab");
    if (const auto [other, is_new] = lines.emplace(name, number); !is_new)
      throw UsageError(where + "its scene would be " + name + ".ply, as that of line " + std::to_string(other->second) +
                       ": give one of them another name, after the views and a tab");
    out.push_back({views, (fs::path(request.output) / (name + ".ply")).string(), out.size()});
  }
  if (out.empty()) throw UsageError(request.list + " lists no views");
  return out;
}

// Whether an error concerns one object only. Other errors end the list.
bool is_about_object(const vsplat::Error& e) {
  return e.status() == VSPLAT_ERROR_FILE || e.status() == VSPLAT_ERROR_FORMAT || e.status() == VSPLAT_ERROR_INPUT ||
         e.status() == VSPLAT_ERROR_USAGE;
}

nlohmann::ordered_json json_of(const Object& object) {
  nlohmann::ordered_json out = {{"views", object.views}, {"output", object.output}};
  if (object.error.empty())
    out.update({{"gaussians", object.gaussians}, {"seconds", object.seconds}});
  else
    out["error"] = object.error;
  return out;
}

// Results of the list from all ranks, on rank 0.
struct ListResults {
  std::map<std::size_t, nlohmann::ordered_json> objects;  // by index in the list
  std::size_t skipped = 0, failed = 0;
};

ListResults gathered(const std::vector<Object>& objects, std::size_t skipped) {
  nlohmann::ordered_json own = {{"objects", nlohmann::ordered_json::array()}, {"skipped", skipped}};
  for (const Object& object : objects)
    if (object.is_done) own["objects"].push_back({{"place", object.place}, {"row", json_of(object)}});
  ListResults out;
  const auto take = [](void* user, int32_t, const char* text) {
    auto& to = *static_cast<ListResults*>(user);
    const auto from = nlohmann::ordered_json::parse(text);
    to.skipped += from["skipped"].get<std::size_t>();
    for (const auto& each : from["objects"]) {
      to.objects[each["place"].get<std::size_t>()] = each["row"];
      to.failed += each["row"].contains("error");
    }
  };
  const std::string text = own.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  vsplat::check(vsplat_ranks_gather(text.c_str(), take, &out));
  return out;
}

}  // namespace

void reconstruct_list(const ListRequest& request) {
  Common& common = request.common;
  const Ranks ranks = join_ranks(common);
  if (ranks.several() && request.list == "-")
    throw UsageError("--list -: only one of several processes has stdin; give a file");
  std::vector<Object> objects = read_list(request);
  std::erase_if(objects, [&](const Object& o) {
    return o.place % static_cast<std::size_t>(ranks.count) != static_cast<std::size_t>(ranks.rank);
  });
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
  if (ranks.leads())
    for (const std::string& path : {common.profile, common.trace}) outputs.expect(path);

  Session session(common, Devices::several);
  const vsplat::Model model = load_model(request.model);
  vsplat_reconstruct_options run = request.run;
  run.progress = [](void*, const char*, double) -> int32_t { return interrupted() ? 0 : 1; };
  session.start("reconstructing");
  const auto work = [&](const vsplat::Device& device, std::size_t i) {
    Object& object = objects[i];
    const double begun = elapsed_seconds();
    std::optional<vsplat::Input> input;
    try {  // no device is used here, so any failure, even lack of host memory, concerns only this object
      input.emplace(model, vsplat::Views::load(object.views, request.views), request.input);
    } catch (const vsplat::Error& e) {
      if (e.status() == VSPLAT_ERROR_CANCELLED) throw;
      object.error = e.what();
      object.seconds = elapsed_seconds() - begun;
      return;
    }
    try {
      object.scene = vsplat::reconstruct(device, model, *input, run);
    } catch (const vsplat::Error& e) {
      if (!is_about_object(e)) throw;
      object.error = e.what();
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
      warn(object.views + " is left out: " + object.error);
    }
    object.is_done = true;
    if (!Session::on_progress(&session, which.c_str(), share)) throw vsplat::Error(VSPLAT_ERROR_CANCELLED, "stopped");
  };
  try {
    vsplat::share_out(session.devices(), objects.size(), work, done);
  } catch (const vsplat::Error& e) {
    if (e.status() != VSPLAT_ERROR_CANCELLED) throw;
    if (ranks.several()) gathered(objects, skipped);  // rank 0 may be waiting for it
    throw std::runtime_error("interrupted: the scenes that were made are in " + request.output +
                             ", and --skip-existing continues from there");
  }
  if (ranks.leads()) session.write_profile(outputs);
  outputs.commit();
  const ListResults all = gathered(objects, skipped);
  if (!ranks.leads()) return;
  const std::size_t made = all.objects.size() - all.failed;
  say(common, request.output + ": " + std::to_string(made) + (made == 1 ? " scene" : " scenes") +
                  (all.skipped ? ", " + std::to_string(all.skipped) + " were there" : "") + ", " +
                  seconds_text(elapsed_seconds()));
  if (common.json) {
    nlohmann::ordered_json out = {{"objects", nlohmann::ordered_json::array()}, {"skipped", all.skipped}};
    for (const auto& [place, row] : all.objects) out["objects"].push_back(row);
    session.add_numerics(out);
    out["seconds"] = elapsed_seconds();
    print_json(out);
  }
  if (all.failed)
    throw std::runtime_error(request.list + ": " + std::to_string(all.failed) + " of " +
                             std::to_string(all.objects.size()) +
                             " objects could not be reconstructed: see the warnings");
}

}  // namespace command

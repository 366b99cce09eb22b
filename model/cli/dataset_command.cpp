// vsplat dataset: makes data sets from meshes (`info` is in a file of its own).
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "command.h"
#include "outputs.h"

namespace command {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct DatasetOptions {
  Common common;
  std::vector<std::string> meshes;
  std::string output, texture, textures, seed = "0";
  bool solids = false;
  int count = 0, views = 40, pixels = 512;
};

std::vector<std::string> names_of(const DatasetOptions& o) {
  std::vector<std::string> out;
  if (o.meshes.empty()) {
    char name[32];
    for (int i = 0; i < o.count; ++i) {
      std::snprintf(name, sizeof name, o.solids ? "solid_%04d" : "object_%04d", i);
      out.emplace_back(name);
    }
    return out;
  }
  std::vector<const char*> paths;
  for (const std::string& mesh : o.meshes) paths.push_back(mesh.c_str());
  char* text = nullptr;
  vsplat::check(vsplat_object_names(paths.data(), paths.size(), &text));
  return ordered_json::parse(vsplat::text(text)).get<std::vector<std::string>>();
}

std::vector<std::string> files_of(const std::string& folder, int views) {
  std::vector<std::string> out;
  char name[32];
  for (int i = 0; i < views; ++i) {
    std::snprintf(name, sizeof name, "images/%04d.png", i);
    out.push_back((fs::path(folder) / name).string());
  }
  out.push_back((fs::path(folder) / "transforms.json").string());
  return out;
}

void expect_all(const DatasetOptions& o, Outputs& outputs, const std::string& folder) {
  for (const std::string& mesh : o.meshes) outputs.input(mesh);
  outputs.input(o.texture);
  const std::vector<std::string> files = files_of(folder, o.views);
  for (const std::string& file : files) outputs.expect(file);
  // Pictures of an earlier run with more views would be removed.
  std::error_code error;
  for (auto at = fs::directory_iterator(fs::path(folder) / "images", error); !error && at != fs::directory_iterator();
       at.increment(error)) {
    const std::string path = at->path().string(), name = at->path().filename().string();
    const bool numbered = name.size() == 8 && name.ends_with(".png") && name.find_first_not_of("0123456789") == 4;
    if (numbered && std::find(files.begin(), files.end(), path) == files.end()) outputs.expect(path);
  }
}

vsplat::Mesh mesh_of(const DatasetOptions& o, std::size_t index, std::uint64_t seed) {
  if (!o.meshes.empty()) return vsplat::Mesh::load(o.meshes[index], o.texture);
  if (o.solids) return vsplat::Mesh::procedural(seed, static_cast<std::uint32_t>(index));
  vsplat_mesh_procedural_options options = VSPLAT_MESH_PROCEDURAL_OPTIONS_INIT;
  options.seed = seed;
  options.index = static_cast<std::uint32_t>(index);
  options.textures = o.textures.empty() ? nullptr : o.textures.c_str();
  return vsplat::Mesh::procedural(options);
}

struct Progress {
  const Common& common;
  std::string what;
  static int32_t tell(void* user, const char*, double done) {
    const auto* self = static_cast<const Progress*>(user);
    show_progress(self->common, self->what + ": " + std::to_string(static_cast<int>(100 * done)) + " %");
    return interrupted() ? 0 : 1;
  }
};

ordered_json write(const DatasetOptions& o, std::size_t index, const std::string& name, std::uint64_t seed) {
  const std::string folder = (fs::path(o.output) / name).string();
  Outputs outputs(o.common.overwrite);
  expect_all(o, outputs, folder);
  const auto number = static_cast<std::uint32_t>(index);
  const vsplat::Mesh mesh = mesh_of(o, index, seed);
  const vsplat_mesh_info info = mesh.info();
  Progress progress{o.common, name};
  vsplat_mesh_views_options options = VSPLAT_MESH_VIEWS_OPTIONS_INIT;
  options.views = o.views;
  options.pixels = o.pixels;
  options.seed = seed;
  options.index = number;
  options.progress = Progress::tell;
  options.user = &progress;
  mesh.write_views(folder, options);  // replaces the object whole or not at all, so outputs.begin() is not needed
  outputs.commit();
  clear_progress();
  say(o.common, folder + ": " + std::to_string(o.views) + " pictures of " + std::to_string(info.triangles) +
                    " triangles, " + std::to_string(info.textures) + " textures");
  ordered_json out = {{"name", name}, {"folder", folder}, {"triangles", info.triangles}, {"textures", info.textures}};
  if (!o.meshes.empty()) out["mesh"] = o.meshes[index];
  return out;
}

void make(const DatasetOptions& o) {
  set_up_library(o.common);
  const std::uint64_t seed = seed_value("--seed", o.seed);
  const std::vector<std::string> names = names_of(o);
  // Checks all of the files before reading the first mesh.
  for (const std::string& name : names) {
    Outputs outputs(o.common.overwrite);
    expect_all(o, outputs, (fs::path(o.output) / name).string());
  }
  ordered_json objects = ordered_json::array();
  for (std::size_t i = 0; i < names.size(); ++i) {
    try {
      objects.push_back(write(o, i, names[i], seed));
    } catch (const vsplat::Error& e) {
      const std::string done = std::to_string(i) + " of " + std::to_string(names.size()) + " objects were written";
      if (i > 0 && e.status() == VSPLAT_ERROR_CANCELLED) throw std::runtime_error("stopped; " + done);
      if (i > 0) say(o.common, done);
      throw;
    }
  }
  if (o.common.json)
    print_json(ordered_json{{"output", o.output}, {"views", o.views}, {"size", o.pixels}, {"objects", objects}});
}

void add_shared(CLI::App& sub, DatasetOptions& o, bool reads) {
  sub.add_option("-o,--output", o.output, "The folder to write; each object gets a folder in it")
      ->required()
      ->type_name("DIR");
  sub.add_option("--views", o.views, "Number of pictures of each object (default: 40)")
      ->check(CLI::Range(1, 9999))
      ->type_name("N");
  sub.add_option("--size", o.pixels, "Width and height of the pictures in pixels (default: 512)")
      ->check(CLI::Range(8, 8192))
      ->type_name("N");
  sub.add_option("--seed", o.seed, "Seed of all random choices (default: 0)")->type_name("S");
  add_common(sub, o.common, {.device = false, .profile = false, .outside = reads});
}

void add_render_action(CLI::App& parent, Run& run) {
  auto o = std::make_shared<DatasetOptions>();
  CLI::App* sub = parent.add_subcommand("render", "Draw meshes from all sides, each into a folder of its own");
  sub->add_option("meshes", o->meshes, "OBJ, PLY, STL, GLB or glTF files")->required()->type_name("MESH...");
  sub->add_option("--texture", o->texture, "A picture that covers every mesh instead of its own textures and colours")
      ->type_name("PICTURE");
  add_shared(*sub, *o, true);
  sub->footer(
      "An object's folder has the name of its file, or of the file's folder if names repeat or are \"model\".\n"
      "Each object is scaled into the cube with edge 1 around the origin. Finished objects stay if a later one\n"
      "fails.\n"
      "Examples:\n"
      "  vsplat dataset render meshes/*.glb --output set\n"
      "  vsplat dataset render cup/model.obj bowl/model.obj --texture wood.jpg --output set --views 20 --size 256");
  sub->callback([o, &run] { run = [o] { make(*o); }; });
}

void add_procedural_action(CLI::App& parent, Run& run) {
  auto o = std::make_shared<DatasetOptions>();
  CLI::App* sub = parent.add_subcommand("procedural", "Draw random objects, each into a folder of its own");
  sub->add_option("--count", o->count, "Number of objects")->required()->check(CLI::Range(1, 9999))->type_name("N");
  CLI::Option* textures =
      sub->add_option("--textures", o->textures,
                      "A folder of pictures; half of the objects' parts get one of them as a texture")
          ->type_name("DIR");
  sub->add_flag("--solids", o->solids, "Plain objects: one to four whole bodies with patterns")->excludes(textures);
  add_shared(*sub, *o, false);
  sub->footer(
      "Each object is one to nine parts: bodies, some with others cut out of them or with a height field, wire\n"
      "frames, thin rods, plates, hoops and springs; some twisted, bent or tapered; of one colour, a gradient, a\n"
      "pattern or a texture. The same seed, index and pictures of --textures give the same object.\n"
      "Example:\n"
      "  vsplat dataset procedural --count 16 --output objects --textures pictures --size 128 --seed 7");
  sub->callback([o, &run] { run = [o] { make(*o); }; });
}

}  // namespace

void add_dataset(CLI::App& app, Run& run) {
  CLI::App* sub = app.add_subcommand("dataset", "Make data sets of posed pictures, and show what they hold");
  sub->require_subcommand(1);
  add_render_action(*sub, run);
  add_procedural_action(*sub, run);
  add_info_action(*sub, run);
  sub->footer(
      "Examples:\n  vsplat dataset render meshes/*.glb --output set\n"
      "  vsplat dataset procedural --count 16 --output objects\n"
      "  vsplat dataset info set --sheet set.png");
}

}  // namespace command

#include "scene_file.h"

#include <cstdio>
#include <filesystem>
#include <optional>
#include <sstream>

#include "arguments.h"
#include "scene_page.h"

namespace command {
namespace {

// The written format whose ending the path has, the longest one that matches; nothing if there is none.
std::optional<vsplat_scene_format> format_of(const std::string& path) {
  const std::string name = lower_case(std::filesystem::path(path).filename().string());
  std::optional<vsplat_scene_format> out;
  std::size_t longest = 0;
  for (const vsplat_scene_format& format : vsplat::scene_formats()) {
    std::istringstream endings(format.writes ? format.endings : "");
    for (std::string ending; endings >> ending;) {
      if (name.size() <= ending.size() || ending.size() <= longest || !name.ends_with(ending)) continue;
      out = format;
      longest = ending.size();
    }
  }
  return out;
}

}  // namespace

void need_scene_ending(const std::string& option, const std::string& path, bool or_page) {
  if (path.empty() || (or_page && is_page(path)) || format_of(path)) return;
  std::string all;
  for (const vsplat_scene_format& format : vsplat::scene_formats())
    if (format.writes) all += (all.empty() ? "" : ", ") + std::string(format.endings) + " (" + format.title + ")";
  if (or_page) all += ", .html (a page)";
  throw UsageError(option + " is \"" + path + "\": a name with the ending of a scene's format expected: " + all);
}

vsplat::Scene load_scene(const std::string& path, bool skip_bad) {
  vsplat_scene_load_options options = VSPLAT_SCENE_LOAD_OPTIONS_INIT;
  options.skip_bad = skip_bad;
  return vsplat::Scene::load(path, options);
}

vsplat::Scene copy_of(const vsplat::Scene& scene) {
  vsplat::Scene out = vsplat::Scene::create(vsplat::ConstGaussianSpans{}, 0);
  out.append(scene);
  return out;
}

std::vector<std::string> tell_losses(const Common& common, const std::string& path, const vsplat::Scene& scene,
                                     const std::string& format) {
  std::vector<std::string> out;
  std::istringstream lost(scene.losses(format));
  for (std::string sentence; std::getline(lost, sentence);) {
    say(common, path + ": " + sentence);
    out.push_back(sentence);
  }
  return out;
}

SceneFile::SceneFile(Outputs& outputs, const std::string& path) : outputs_(outputs), path_(is_page(path) ? "" : path) {
  if (!path_.empty()) offset_path_ = std::filesystem::path(path_).replace_extension(".offset.json").string();
  outputs.expect(path_);
  outputs.expect(offset_path_);
}

void SceneFile::save(const Common& common, const vsplat::Scene& scene, const vsplat_scene_save_options& options,
                     const std::vector<unsigned char>* made) {
  if (path_.empty()) return;
  const vsplat_scene_info info = scene.info();
  if (is_set(info.offset)) offset_.assign(info.offset, info.offset + 3);
  if (offset_.empty()) {
    outputs_.expect_gone(offset_path_);  // an older one would be taken for this scene's
  } else {
    outputs_.begin(offset_path_);  // which save() writes
    char text[128];
    std::snprintf(text, sizeof text, "(%.12g, %.12g, %.12g)", offset_[0], offset_[1], offset_[2]);
    say(common, path_ + ": is too far from the world's origin for floats: its positions are relative to " + text +
                    ", which " + offset_path_ + " tells other programs");
  }
  outputs_.begin(path_);
  if (made && offset_.empty())
    vsplat::check(vsplat_file_write(path_.c_str(), made->data(), made->size()));
  else
    scene.save(path_, options);
  lost_ = tell_losses(common, path_, scene, format());
}

std::string SceneFile::format() const {
  const std::optional<vsplat_scene_format> found = format_of(path_);
  return found ? found->name : "";
}

void SceneFile::add_results(nlohmann::ordered_json& out) const {
  if (!lost_.empty()) out["lost"] = lost_;
  if (offset_.empty()) return;
  out["offset"] = offset_;
  out["offset_file"] = offset_path_;
}

}  // namespace command

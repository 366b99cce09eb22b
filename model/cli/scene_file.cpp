#include "scene_file.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "scene_page.h"

namespace command {

SceneFile::SceneFile(Outputs& outputs, const std::string& path)
    : outputs_(outputs), path_(is_page(path) ? "" : path) {
  if (!path_.empty()) offset_path_ = std::filesystem::path(path_).replace_extension(".offset.json").string();
  outputs.expect(path_);
  outputs.expect(offset_path_);
}

void SceneFile::save(const Common& common, const vsplat::Scene& scene) {
  if (path_.empty()) return;
  const vsplat_scene_info info = scene.info();
  if (std::any_of(info.offset, info.offset + 3, [](double v) { return v != 0; }))
    offset_.assign(info.offset, info.offset + 3);
  if (offset_.empty()) {
    outputs_.expect_gone(offset_path_);  // an older one would be taken for this scene's
  } else {
    outputs_.begin(offset_path_);  // which save() writes
    char text[128];
    std::snprintf(text, sizeof text, "(%.12g, %.12g, %.12g)", offset_[0], offset_[1], offset_[2]);
    say(common, path_ + ": is too far from the world's origin for floats: its positions are relative to " + text +
                    ", which " + offset_path_ + " tells other programs");
  }
  scene.save(outputs_.begin(path_));
}

void SceneFile::add_results(nlohmann::ordered_json& out) const {
  if (offset_.empty()) return;
  out["offset"] = offset_;
  out["offset_file"] = offset_path_;
}

}  // namespace command

// The scene that a command writes, and a file beside it if other programs would misplace the scene.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "command.h"
#include "outputs.h"

namespace command {

// UsageError unless `path`, which may be "", has the ending of a format in which scenes are written, or that of a page
// (scene_page.h) if `or_page`.
void need_scene_ending(const std::string& option, const std::string& path, bool or_page = false);
// With `skip_bad`, Gaussians that cannot be drawn are left out and counted.
vsplat::Scene load_scene(const std::string& path, bool skip_bad);
// A scene that changes of the other one leave as it is.
vsplat::Scene copy_of(const vsplat::Scene& scene);
// Says what a file of this format, called `path`, loses of the scene, and returns the sentences.
std::vector<std::string> tell_losses(const Common& common, const std::string& path, const vsplat::Scene& scene,
                                     const std::string& format);

class SceneFile {
 public:
  // Expects both files as outputs. `path` may be "", or a page (scene_page.h), which holds the scene itself: nothing is
  // written here.
  SceneFile(Outputs& outputs, const std::string& path);

  // Writes the scene; also SCENE.offset.json, with a message, if its positions are relative to an offset rather than in
  // the world. `made`, if not null, is what the file will hold; it was made with the same options.
  void save(const Common& common, const vsplat::Scene& scene,
            const vsplat_scene_save_options& options = VSPLAT_SCENE_SAVE_OPTIONS_INIT,
            const std::vector<unsigned char>* made = nullptr);
  // The name of the format in which it is written; "" without a path.
  std::string format() const;
  // Adds what save() has lost, if anything, and the offset, if there is one.
  void add_results(nlohmann::ordered_json& out) const;

 private:
  Outputs& outputs_;
  std::string path_, offset_path_;
  std::vector<double> offset_;     // empty: 0
  std::vector<std::string> lost_;  // sentences
};

}  // namespace command

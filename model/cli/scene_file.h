// The scene that a command writes, and what stands beside it where other programs would misplace it.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vsplat/vsplat.hpp>

#include "command.h"
#include "outputs.h"

namespace command {

class SceneFile {
 public:
  // Expects both files. `path` may be "": none is written.
  SceneFile(Outputs& outputs, const std::string& path);

  // The scene; and SCENE.offset.json where positions in it are not in the world but relative to an offset, which is
  // said.
  void save(const Common& common, const vsplat::Scene& scene);
  void add_results(nlohmann::ordered_json& out) const;

 private:
  Outputs& outputs_;
  std::string path_, offset_path_;
  std::vector<double> offset_;  // none: 0
};

}  // namespace command

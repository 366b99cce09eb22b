// What a scene file says about itself before it is read.
#pragma once
#include <cstdint>
#include <string>

#include "model/io/scene/scene_format.h"

namespace vsplat {

struct SceneFileFacts {
  const SceneFormat* format = nullptr;
  std::string version;  // as the file states it: "binary_little_endian 1.0"; "" if the format has none
  std::string axes;     // of the positions in the file, as in axes.h; "" if the format does not define them
  std::uint64_t bytes = 0;
};

// Reads only the file's beginning. Errors as read_scene() for files that are no scenes.
SceneFileFacts facts_of_scene_file(const std::string& path);

}  // namespace vsplat

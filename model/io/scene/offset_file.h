// SCENE.offset.json: the origin of a scene's positions in the world, for programs that do not read our PLY comments.
#pragma once
#include <filesystem>

#include "model/base/scene.h"

namespace vsplat {

// The file that belongs to the scene file `scene`.
std::filesystem::path offset_file_of(const std::filesystem::path& scene);

// Writes it if `scene` has an offset. Otherwise removes the file that an earlier scene of this name has left, which
// would misplace the new one. Error(file) as in OutputFile.
void write_offset_file(const std::filesystem::path& path, const Scene& scene);

}  // namespace vsplat

// SCENE.offset.json: where in the world a scene's positions begin, for programs that do not read our PLY comments.
#pragma once
#include <filesystem>

#include "model/base/scene.h"

namespace vsplat {

// The file that belongs to the scene file `scene`.
std::filesystem::path offset_file_of(const std::filesystem::path& scene);

// Writes it where `scene` has an offset. Otherwise removes one that an earlier scene of this name left, which would
// misplace this one. Error(file) as OutputFile has it.
void write_offset_file(const std::filesystem::path& path, const Scene& scene);

}  // namespace vsplat

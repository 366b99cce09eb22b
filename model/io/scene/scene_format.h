// The formats of scene files: one table, by which scenes are read and written.
#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "model/base/scene.h"
#include "model/io/scene/skipped_gaussians.h"

namespace vsplat {

struct SceneWriteOptions {
  int spz_version = 4;  // 2 to 4
};

// What a format holds besides the Gaussians, and whether these may be surfels.
struct SceneFieldSet {
  bool surfels = false, near = false, up = false, mirror = false, detail = false, offset = false, antialias = false;
};

struct SceneFormat {
  std::string_view name;     // "compressed-ply"
  std::string_view title;    // "PlayCanvas compressed PLY"
  std::string_view endings;  // lower case, separated by spaces; of two that match, the longer one counts
  int sh_read = 3;           // highest degree of spherical harmonics
  int sh_written = 3;
  bool lossless = false;  // values are kept to a few units of the last place of a float
  SceneFieldSet kept;
  std::string_view lost;       // what no file of the format holds, for the table in the documents
  std::string_view opened_by;  // other programs
  // Identifies a file by its first bytes, kSceneBeginning of them or the whole file; null: only the ending says so.
  bool (*recognises)(std::span<const std::byte> beginning) = nullptr;
  // Reads a file's content; errors as read_scene(). Null: not read.
  Scene (*read)(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped) = nullptr;
  // The same from a path, where the file need not be in memory; null: the file is read whole, and passed to read().
  Scene (*read_path)(const std::string& path, SkippedGaussians* skipped) = nullptr;
  // Writes a file whole or not at all; errors as OutputFile's. Null: not written.
  void (*write)(const std::string& path, const Scene& scene, const SceneWriteOptions& options) = nullptr;
  // How a written file rounds the values of `scene`, a sentence for each group of them; null: not at all.
  std::vector<std::string> (*rounding)(const Scene& scene) = nullptr;
};

inline constexpr std::size_t kSceneBeginning = 4096;

std::span<const SceneFormat> scene_formats();
// Error(usage) with the names of the table if none is called `name`.
const SceneFormat& scene_format(std::string_view name);
// The format that is written to files of this ending, in any case. Error(usage) with the table's endings if there is
// none.
const SceneFormat& written_format(const std::string& path);

// The format of a file with these first bytes, kSceneBeginning of them or the whole file, and this name. Errors as
// read_scene().
const SceneFormat& read_format(const std::string& name, std::span<const std::byte> beginning);

// Reads a scene of any format, identified by its content, and by its ending where the content does not say. Damaged
// files throw Error(format) with the path, the field and its byte, files of other kinds with what they are. With
// `skipped`, Gaussians that cannot be drawn are omitted and counted there, and a warning reports their number; without
// it, the first one is an error.
Scene read_scene(const std::string& path, SkippedGaussians* skipped = nullptr);
// Reads a file's bytes in memory; `name` replaces the path in errors.
Scene read_scene(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped = nullptr);

// Writes the format of the path's ending. Errors as written_format(), and as OutputFile's.
void write_scene(const std::string& path, const Scene& scene, const SceneWriteOptions& options = {});

// What a file of this format loses of this scene: a sentence for each field. Empty if it keeps all.
std::vector<std::string> losses(const SceneFormat& format, const Scene& scene);

}  // namespace vsplat

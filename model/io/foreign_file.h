// Identifies a file of another kind than expected, for error messages. Nothing here reads its content.
#pragma once
#include <optional>
#include <string>
#include <string_view>

namespace vsplat {

struct ForeignFile {
  std::string name;         // "a GIF picture, which is not read"
  std::string advice = {};  // how to convert it to something readable; "" if unknown

  // "a GIF picture, which is not read, where a 3DGS PLY is expected; convert it: ..."
  std::string where(const std::string& expected) const;
};

// Identifies a file by its first bytes (a few hundred are enough) and otherwise by the path's ending.
std::optional<ForeignFile> what_file_is(const std::string& path, std::string_view begin);

// The command that converts a scene in another format to a 3DGS PLY.
std::string how_to_convert_scene(const std::string& path);

}  // namespace vsplat

// What a file is that is given where another kind of file is expected, for messages. Nothing here reads it.
#pragma once
#include <optional>
#include <string>
#include <string_view>

namespace vsplat {

struct ForeignFile {
  std::string name;         // "a GIF picture, which is not read"
  std::string advice = {};  // what makes something of it that is read; "": nothing that is known

  // "a GIF picture, which is not read, where a 3DGS PLY is expected; convert it: ..."
  std::string where(const std::string& expected) const;
};

// By its beginning (some hundred bytes are enough) and, where that says nothing, by the path's ending.
std::optional<ForeignFile> what_file_is(const std::string& path, std::string_view begin);

// A command that makes a 3DGS PLY of a scene in another format.
std::string how_to_convert_scene(const std::string& path);

}  // namespace vsplat

// The text of OBJ and MTL files, made such that assimp reads it rightly, and what assimp would pass over in it.
#pragma once
#include <array>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "model/io/reader/program/library.h"

namespace vsplat::read {

// How a texture lies on the surface: its place is scale x (u, v) + offset.
struct MtlTexture {
  std::array<float, 2> scale{1, 1}, offset{0, 0};
  bool clamp = false;
};

struct MtlMaterial {
  MtlTexture diffuse, emission;
};

// Without a byte order mark, carriage returns and blanks at lines' ends.
void clean_lines(std::string& text);

// The materials of all MTL files of a mesh.
class MtlMaterials {
 public:
  // The text of the file `path` for assimp: clean lines, and texture lines without options, comments and quotes. Notes
  // what the options say; options that change a texture's colours become refused().
  std::string take(const std::string& path, std::string text);

  // Looks through the clean text of the OBJ file for the materials that it uses.
  void look_for_uses(std::string_view obj);
  // Once all files are read: notes what is used and is in none of them.
  void note_unknown();

  const MtlMaterial* find(const std::string& name) const;
  // What the user should know.
  const std::vector<std::string>& notes() const { return notes_; }
  // The first thing that must not be passed over. (What is thrown within assimp loses its place.)
  const std::optional<Wrong>& refused() const { return refused_; }

 private:
  struct Line;
  std::string texture_line(const Line& line);
  std::string colour_line(const Line& line);
  void end_material();

  std::map<std::string, MtlMaterial> all_;
  std::string name_, diffuse_file_;  // of the material that is being read
  bool has_ambient_ = false;         // its, a texture
  std::set<std::string> used_;
  std::vector<std::string> notes_;
  std::optional<Wrong> refused_;
};

}  // namespace vsplat::read

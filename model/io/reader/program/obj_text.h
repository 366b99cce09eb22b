// Adapts the text of OBJ and MTL files so that assimp reads it correctly, and extracts what assimp ignores.
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

// Placement of a texture on the surface: scale x (u, v) + offset.
struct MtlTexture {
  std::array<float, 2> scale{1, 1}, offset{0, 0};
  bool clamp = false;
};

struct MtlMaterial {
  MtlTexture diffuse, emission;
};

// Removes a byte order mark, carriage returns and blanks at the ends of lines.
void clean_lines(std::string& text);

// An OBJ file's clean text with a line for each material file: assimp takes the rest of a mtllib line for one name.
// Names may hold blanks, so a line is only split between names that end in .mtl.
std::string split_libraries(std::string_view text);

// The materials of all MTL files of a mesh.
class MtlMaterials {
 public:
  // Returns the text of the file `path` for assimp: clean lines, and texture lines without options, comments and
  // quotes. Records the options; an option that changes a texture's colours sets refused().
  std::string take(const std::string& path, std::string text);

  // Searches the clean text of the OBJ file for the materials that it uses, and for numbers that assimp misreads.
  void look_for_uses(const std::string& path, std::string_view obj);
  // Call it when all files are read: notes the materials that are used but defined in no file.
  void note_unknown();

  const MtlMaterial* find(const std::string& name) const;
  // Messages for the user.
  const std::vector<std::string>& notes() const { return notes_; }
  // The first unsupported option. It is not thrown, because exceptions that pass through assimp lose their place.
  const std::optional<Wrong>& refused() const { return refused_; }

 private:
  struct Line;
  std::string texture_line(const Line& line);
  std::string colour_line(const Line& line);
  void end_material();
  void refuse_fortran(const std::string& path, long number, std::string_view line);

  std::map<std::string, MtlMaterial> all_;
  std::string name_, diffuse_file_;  // of the material that is being read
  bool has_ambient_ = false;         // whether that material has an ambient texture
  std::set<std::string> used_;
  std::vector<std::string> notes_;
  std::optional<Wrong> refused_;
};

}  // namespace vsplat::read

#include "model/io/reader/program/ply_notes.h"

#include <fmt/format.h>

#include <set>
#include <sstream>

#include "model/io/reader/program/mesh_files.h"
#include "runtime/printable.h"

namespace vsplat::read {
namespace {

constexpr std::size_t longest_header = 1 << 16;

}  // namespace

void note_ply_header(const std::string& path, Library& library) {
  std::string head = beginning_of(path, library, longest_header);
  clean_lines(head);
  std::istringstream lines(head);
  std::string element, texture;
  std::set<std::string> noted;
  const auto note = [&](const std::string& text) {
    if (noted.insert(text).second) library.say(Kind::note, Packer().text(text));
  };
  for (std::string line; std::getline(lines, line) && line != "end_header";) {
    std::istringstream words(line);
    std::string word, second, name;
    words >> word >> second;
    if (word == "element") element = second;
    if (word == "comment" && second == "TextureFile") {
      std::getline(words >> std::ws, name);
      if (!texture.empty() && name != texture)
        fail_reading(
            Status::input, "",
            fmt::format("names several textures, {} and {}, but only one is read; save it with one, or as OBJ or glTF",
                        printable(texture), printable(name)));
      texture = name;
    }
    if (word != "property" || second == "list") continue;
    words >> name;
    if (element == "face" && (name == "red" || name == "diffuse_red"))
      note("the colours of its faces are not read; colour its vertices instead");
    if (element == "vertex" && name == "diffuse_red")
      note(
          "its vertices' colours are called diffuse_red, diffuse_green and diffuse_blue and are not read; call them "
          "red, green and blue");
  }
}

}  // namespace vsplat::read

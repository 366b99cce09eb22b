#include "model/io/reader/program/obj_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <set>

#include "runtime/printable.h"

namespace vsplat::read {
namespace {

constexpr std::string_view blanks = " \t\v\f";

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == text.npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

std::string_view trimmed_left(std::string_view text) {
  return text.substr(std::min(text.find_first_not_of(blanks), text.size()));
}

// Removes and returns the first word.
std::string_view take_word(std::string_view& text) {
  text = trimmed(text);
  const std::string_view word = text.substr(0, text.find_first_of(blanks));
  text = trimmed(text.substr(word.size()));
  return word;
}

std::string lower(std::string_view word) {
  std::string out(word);
  std::transform(out.begin(), out.end(), out.begin(), [](unsigned char c) { return std::tolower(c); });
  return out;
}

bool is_number(std::string_view word, float& value) {
  const char* first = word.data() + (word.size() > 1 && word[0] == '+');
  const char* last = word.data() + word.size();
  const auto [end, problem] = std::from_chars(first, last, value);
  return problem == std::errc() && end == last && std::isfinite(value);
}

// Takes up to `most` leading numbers; at least one word must remain, because a file name follows.
std::vector<float> take_numbers(std::string_view& text, std::size_t most) {
  std::vector<float> out;
  float value = 0;
  while (out.size() < most) {
    std::string_view rest = text;
    if (!is_number(take_word(rest), value) || rest.empty()) break;
    out.push_back(value);
    text = rest;
  }
  return out;
}

std::string_view without_comment(std::string_view text) {
  for (std::size_t i = 1; i < text.size(); ++i)
    if (text[i] == '#' && blanks.find(text[i - 1]) != blanks.npos) return trimmed(text.substr(0, i));
  return text;
}

bool is_texture_line(const std::string& word) {
  static const std::set<std::string> words{"map_kd", "map_ka",   "map_ks",  "map_ke", "map_emissive",
                                           "map_d",  "map_bump", "map_ns",  "bump",   "disp",
                                           "decal",  "norm",     "map_disp"};
  return words.count(word) > 0;
}

}  // namespace

void clean_lines(std::string& text) {
  constexpr std::string_view mark = "\xef\xbb\xbf";
  std::size_t to = 0, from = text.starts_with(mark) ? mark.size() : 0, line = 0;
  for (; from < text.size(); ++from) {
    const char c = text[from];
    if (c != '\n' && c != '\r') {
      text[to++] = c;
      continue;
    }
    if (c == '\r' && from + 1 < text.size() && text[from + 1] == '\n') continue;
    while (to > line && blanks.find(text[to - 1]) != blanks.npos) --to;
    text[to++] = '\n';
    line = to;
  }
  while (to > line && blanks.find(text[to - 1]) != blanks.npos) --to;
  text.resize(to);
}

std::string split_libraries(std::string_view text) {
  constexpr std::string_view word = "mtllib ", ending = ".mtl";
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    std::string_view line = text.substr(0, std::min(text.find('\n'), text.size() - 1) + 1);
    text.remove_prefix(line.size());
    if (line.starts_with(word))
      for (std::size_t at = word.size(); (at = line.find_first_of(blanks, at)) != line.npos; ++at) {
        if (at < ending.size() || lower(line.substr(at - ending.size(), ending.size())) != ending) continue;
        out.append(line.substr(0, at)).append("\n").append(word);
        line = trimmed_left(line.substr(at));
        at = 0;
      }
    out.append(line);
  }
  return out;
}

struct MtlMaterials::Line {
  const std::string& path;
  std::size_t number;
  std::string word;       // such as "map_Kd"
  std::string_view rest;  // the rest of the line
};

// Parses the texture options that precede the file name.
std::string MtlMaterials::texture_line(const Line& line) {
  const std::string kind = lower(line.word);
  const auto refuse = [&](const std::string& what) {
    if (!refused_)
      refused_ = Wrong(Status::input, fmt::format("{}, line {}", printable(line.path), line.number),
                       fmt::format("{} with {}: this option changes the texture and is not read; apply it to the "
                                   "picture and remove the option",
                                   line.word, what));
  };
  const bool seen = kind == "map_kd" || kind == "map_ke" || kind == "map_emissive";
  MtlTexture texture;
  std::string_view rest = without_comment(line.rest);
  while (rest.starts_with('-')) {
    std::string_view after = rest;
    const std::string option = lower(take_word(after));
    if (after.empty()) break;  // a file name that begins with a dash
    if (option == "-o" || option == "-s" || option == "-t") {
      const std::vector<float> values = take_numbers(after, 3);
      if (values.empty()) break;
      const bool any = std::any_of(values.begin(), values.end(), [](float v) { return v != 0; });
      if (option == "-t" && any && seen) refuse("-t, a turbulence");
      for (std::size_t i = 0; i < 2 && i < values.size() && option != "-t"; ++i)
        (option == "-o" ? texture.offset : texture.scale)[i] = values[i];
    } else if (option == "-mm") {
      const std::vector<float> values = take_numbers(after, 2);
      if (values.empty()) break;
      if (seen && (values[0] != 0 || (values.size() > 1 && values[1] != 1)))
        refuse(fmt::format("-mm {}", fmt::join(values, " ")));
    } else if (option == "-clamp") {
      texture.clamp = lower(take_word(after)) == "on";
    } else if (option == "-blendu" || option == "-blendv" || option == "-boost" || option == "-texres" ||
               option == "-bm" || option == "-imfchan" || option == "-type" || option == "-cc" ||
               option == "-colorspace") {
      take_word(after);  // skips the option's value
    } else {
      break;
    }
    rest = after;
  }
  if (rest.size() > 1 && rest.front() == '"' && rest.back() == '"') rest = trimmed(rest.substr(1, rest.size() - 2));
  if (kind == "map_kd") all_[name_].diffuse = texture, diffuse_file_ = rest;
  if (kind == "map_ke" || kind == "map_emissive") all_[name_].emission = texture;
  if (kind == "map_d" && rest != diffuse_file_)
    notes_.push_back(fmt::format(
        "material \"{}\": the holes of {} (map_d) are not drawn; put them into the alpha of map_Kd's texture",
        printable(name_), printable(rest)));
  return fmt::format("{} {}", kind == "map_kd" ? "map_Kd" : line.word, rest);
}

// Rewrites a colour for assimp: three numbers, or a single grey value repeated. Refuses the forms spectral and xyz.
std::string MtlMaterials::colour_line(const Line& line) {
  const std::string kind = lower(line.word);
  std::string_view rest = without_comment(line.rest), after = rest;
  const std::string form = lower(take_word(after));
  if ((form == "spectral" || form == "xyz") && (kind == "kd" || kind == "ke") && !refused_)
    refused_ = Wrong(
        Status::input, fmt::format("{}, line {}", printable(line.path), line.number),
        fmt::format("{} {}: this form of a colour is not read; write it as {} r g b", line.word, form, line.word));
  float value = 0;
  const bool single = after.empty() && is_number(rest, value);
  const std::string numbers = single ? fmt::format("{0} {0} {0}", rest) : std::string(rest);
  return fmt::format("K{} {}", kind[1], numbers);
}

// Notes problems of the current material, once all of its lines have been read.
void MtlMaterials::end_material() {
  if (has_ambient_ && diffuse_file_.empty())
    notes_.push_back(fmt::format("material \"{}\": its only texture is map_Ka, which is not drawn; name it as map_Kd",
                                 printable(name_)));
  has_ambient_ = false;
  diffuse_file_.clear();
}

std::string MtlMaterials::take(const std::string& path, std::string text) {
  clean_lines(text);
  std::string out;
  std::string_view left = text;
  for (std::size_t number = 1; !left.empty(); ++number) {
    const std::string_view line = left.substr(0, left.find('\n'));
    left.remove_prefix(std::min(line.size() + 1, left.size()));
    std::string_view rest = line;
    const std::string word(take_word(rest));
    const std::string kind = lower(word);
    if (kind == "newmtl") {
      end_material();
      name_ = without_comment(rest);
      all_[name_];
      out += fmt::format("newmtl {}\n", name_);
    } else if (is_texture_line(kind)) {
      has_ambient_ |= kind == "map_ka";
      out += texture_line({path, number, word, rest}) + "\n";
    } else if (kind == "kd" || kind == "ke" || kind == "ka" || kind == "ks") {
      out += colour_line({path, number, word, rest}) + "\n";
    } else {
      out += std::string(trimmed(line)) + "\n";
    }
  }
  end_material();
  return out;
}

// Fortran programs write 1.5D-01 for 0.15; assimp would read 1.5.
void MtlMaterials::refuse_fortran(const std::string& path, long number, std::string_view line) {
  const std::size_t at = line.substr(0, line.find('#')).find_first_of("dD", 2);
  if (at == line.npos || refused_) return;
  const std::size_t first = line.find_last_of(blanks, at) + 1;
  refused_ = Wrong(Status::format, fmt::format("{}, line {}", printable(path), number),
                   fmt::format("\"{}\", a number is expected: its exponent is written with e",
                               printable(line.substr(first, line.find_first_of(blanks, at) - first))));
}

void MtlMaterials::look_for_uses(const std::string& path, std::string_view obj) {
  constexpr std::size_t most = 10000;
  for (long number = 1; !obj.empty(); ++number) {
    std::string_view line = obj.substr(0, obj.find('\n'));
    obj.remove_prefix(std::min(line.size() + 1, obj.size()));
    if (line.starts_with("v ") || line.starts_with("vt ") || line.starts_with("vn "))
      refuse_fortran(path, number, line);
    if (!line.starts_with("usemtl")) continue;
    take_word(line);
    if (!line.empty() && used_.size() < most) used_.emplace(line);
  }
}

void MtlMaterials::note_unknown() {
  for (const std::string& name : used_)
    if (!all_.empty() && all_.count(name) == 0 && all_.count(std::string(without_comment(name))) == 0)
      notes_.push_back(
          fmt::format("material \"{}\" is used, but is in none of its material files: its faces get another material",
                      printable(name)));
}

const MtlMaterial* MtlMaterials::find(const std::string& name) const {
  const auto found = all_.find(name);
  return found == all_.end() ? nullptr : &found->second;
}

}  // namespace vsplat::read

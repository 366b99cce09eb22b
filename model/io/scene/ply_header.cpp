#include "model/io/scene/ply_header.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <map>
#include <sstream>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

template <class T>
double read_as(const unsigned char* data) {
  T value;
  std::memcpy(&value, data, sizeof value);
  return static_cast<double>(value);
}

static_assert(std::endian::native == std::endian::little, "PLY values are copied as they lie in the file");

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> out;
  for (std::string word; in >> word;) out.push_back(word);
  return out;
}

const std::map<std::string, PlyType>& type_names() {
  static const std::map<std::string, PlyType> names{
      {"char", PlyType::i8},   {"int8", PlyType::i8},     {"uchar", PlyType::u8},   {"uint8", PlyType::u8},
      {"short", PlyType::i16}, {"int16", PlyType::i16},   {"ushort", PlyType::u16}, {"uint16", PlyType::u16},
      {"int", PlyType::i32},   {"int32", PlyType::i32},   {"uint", PlyType::u32},   {"uint32", PlyType::u32},
      {"float", PlyType::f32}, {"float32", PlyType::f32}, {"double", PlyType::f64}, {"float64", PlyType::f64}};
  return names;
}

constexpr const char* kFormats[] = {"binary_little_endian", "binary_big_endian", "ascii"};  // in the order of PlyFormat
constexpr std::size_t kMaxProperties = 1024;  // per element; 3DGS files have 62

class Parser {
 public:
  Parser(const std::string& path, const std::string& text) : path_(path), text_(text) {}

  PlyHeader run() {
    if (next() != "ply") bad("a PLY file begins with the line \"ply\"");
    format(words_of(next()));
    for (;;) {
      const std::string line = next();
      const std::vector<std::string> words = words_of(line);
      if (words.empty() || words[0] == "obj_info") continue;
      if (words[0] == "end_header") break;
      if (words[0] == "comment") {
        header_.comments.push_back(line.size() > 8 ? line.substr(8) : "");
      } else if (words[0] == "element") {
        element(words);
      } else if (words[0] == "property") {
        property(words);
      } else {
        bad("\"" + printable(line) + "\" is no line of a PLY header");
      }
    }
    header_.size = at_;
    return std::move(header_);
  }

 private:
  [[noreturn]] void bad(const std::string& what) const {
    fail(Status::format, "{}: header, line {} (byte {}): {}", path_, line_, line_start_, what);
  }

  std::string next() {
    ++line_;
    line_start_ = at_;
    const std::size_t end = text_.find('\n', at_);
    if (end == std::string::npos)
      bad(text_.size() < kMaxPlyHeader ? "the file ends before end_header"
                                       : fmt::format("there is no end_header within {} bytes", kMaxPlyHeader));
    std::string line = text_.substr(at_, end - at_);
    at_ = end + 1;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return line;
  }

  void format(const std::vector<std::string>& words) {
    if (words.size() < 2 || words[0] != "format") bad("\"format\" is expected here");
    const auto known = std::find(std::begin(kFormats), std::end(kFormats), words[1]);
    if (known == std::end(kFormats))
      bad("format \"" + printable(words[1]) +
          "\" is unknown: binary_little_endian, binary_big_endian or ascii is expected");
    header_.format = static_cast<PlyFormat>(known - std::begin(kFormats));
    header_.version = fmt::format("{}", fmt::join(words.begin() + 1, words.end(), " "));
  }

  void element(const std::vector<std::string>& words) {
    PlyElement e;
    if (words.size() != 3) bad("an element has a name and a count");
    e.name = printable(words[1]);
    const char* last = words[2].data() + words[2].size();
    const auto [end, problem] = std::from_chars(words[2].data(), last, e.count);
    if (problem != std::errc() || end != last)
      bad("element " + e.name + ": \"" + printable(words[2]) + "\" is no count: a whole number below 2^64 is expected");
    header_.elements.push_back(std::move(e));
  }

  void property(const std::vector<std::string>& words) {
    if (header_.elements.empty()) bad("a property before any element");
    PlyElement& e = header_.elements.back();
    if (e.columns.size() == kMaxProperties)
      bad(fmt::format("element {} has more than {} properties", e.name, kMaxProperties));
    if (words.size() == 5 && words[1] == "list") {
      e.columns.push_back({type(words[3], words[4]), true, type(words[2], words[4])});
      if (!e.has_list()) e.list = printable(words[4]);
      return;
    }
    if (words.size() != 3) bad("a property has a type and a name");
    if (e.find(words[2])) bad("property " + printable(words[2]) + " is there twice");
    e.properties.push_back({words[2], type(words[1], words[2]), e.stride});
    e.columns.push_back({e.properties.back().type});
    e.stride += size_of(e.properties.back().type);
  }

  PlyType type(const std::string& word, const std::string& property) const {
    const auto type = type_names().find(word);
    if (type == type_names().end())
      bad("property " + printable(property) + ": unknown type \"" + printable(word) + "\"");
    return type->second;
  }

  const std::string& path_;
  const std::string& text_;
  PlyHeader header_;
  std::size_t at_ = 0, line_start_ = 0;
  int line_ = 0;
};

}  // namespace

std::size_t size_of(PlyType type) {
  switch (type) {
    case PlyType::i8:
    case PlyType::u8:
      return 1;
    case PlyType::i16:
    case PlyType::u16:
      return 2;
    case PlyType::f64:
      return 8;
    default:
      return 4;
  }
}

double ply_value(PlyType type, const unsigned char* data) {
  switch (type) {
    case PlyType::i8:
      return read_as<std::int8_t>(data);
    case PlyType::u8:
      return read_as<std::uint8_t>(data);
    case PlyType::i16:
      return read_as<std::int16_t>(data);
    case PlyType::u16:
      return read_as<std::uint16_t>(data);
    case PlyType::i32:
      return read_as<std::int32_t>(data);
    case PlyType::u32:
      return read_as<std::uint32_t>(data);
    case PlyType::f32:
      return read_as<float>(data);
    case PlyType::f64:
      return read_as<double>(data);
  }
  return 0;
}

const PlyProperty* PlyElement::find(const std::string& property) const {
  for (const PlyProperty& p : properties)
    if (p.name == property) return &p;
  return nullptr;
}

PlyHeader parse_ply_header(const std::string& path, const std::string& text) { return Parser(path, text).run(); }

}  // namespace vsplat

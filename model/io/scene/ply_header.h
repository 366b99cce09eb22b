// Parses the header of a PLY file.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vsplat {

enum class PlyType : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
std::size_t size_of(PlyType type);
// The little-endian value at `data`.
double ply_value(PlyType type, const unsigned char* data);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::f32;
  std::size_t offset = 0;  // in bytes from the start of the row
};

// A property in file order; for a list, the types of its length and of its values.
struct PlyColumn {
  PlyType type;
  bool is_list = false;
  PlyType length = PlyType::u8;
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;  // without lists
  std::size_t stride = 0;               // bytes of a row; meaningless if there is a list
  std::string list;                     // the first list property
  std::vector<PlyColumn> columns;       // with lists

  bool has_list() const { return !list.empty(); }
  const PlyProperty* find(const std::string& property) const;
};

enum class PlyFormat : std::uint8_t { little_endian, big_endian, ascii };

struct PlyHeader {
  PlyFormat format = PlyFormat::little_endian;
  std::string version;  // as the file states it: "binary_little_endian 1.0"
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  // without the word "comment"
  std::size_t size = 0;               // in bytes: the offset of the data
};

inline constexpr std::size_t kMaxPlyHeader = std::size_t{1} << 20;  // bytes

// `text` is the file's beginning, up to end_header or kMaxPlyHeader bytes at least. Throws Error(format) with the path,
// the line and the problem.
PlyHeader parse_ply_header(const std::string& path, const std::string& text);

}  // namespace vsplat

#include "model/io/scene/scene_file_facts.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "runtime/files/file.h"

namespace vsplat {
namespace {

std::string_view letters_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// The little-endian number at byte 4, where SPZ and GLB have their version; 0 if the file ends before.
std::uint32_t second_number(std::string_view bytes) {
  std::uint32_t out = 0;
  for (std::size_t i = 8; i-- > 4;) out = out << 8 | (i < bytes.size() ? static_cast<unsigned char>(bytes[i]) : 0u);
  return out;
}

// The first bytes of gzip data.
std::string unzipped_beginning(std::string_view packed) {
  std::array<char, 16> out{};
  z_stream stream{};
  if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) return "";
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  inflate(&stream, Z_SYNC_FLUSH);
  const std::size_t made = out.size() - stream.avail_out;
  inflateEnd(&stream);
  return std::string(out.data(), made);
}

// "binary_little_endian 1.0" of the line "format binary_little_endian 1.0".
std::string ply_version(std::string_view header) {
  constexpr std::string_view word = "\nformat ";
  const std::size_t at = header.find(word);
  if (at == std::string_view::npos) return "";
  const std::string_view rest = header.substr(at + word.size());
  return std::string(rest.substr(0, rest.find_first_of("\r\n")));
}

std::string version_of(std::string_view format, std::string_view beginning) {
  if (format == "ply" || format == "compressed-ply") return ply_version(beginning);
  if (format == "spz" && !beginning.starts_with("NGSP"))
    return fmt::format("version {}", second_number(unzipped_beginning(beginning)));
  if (format == "spz") return fmt::format("version {}", second_number(beginning));
  if (format == "glb") return fmt::format("version {}", second_number(beginning));
  return "";
}

// Where positions point in files of the formats that define it; "" for an SPZ file whose extensions may say otherwise.
std::string axes_of_format(std::string_view format, std::string_view beginning) {
  constexpr std::size_t flags = 14;  // of SPZ's header
  constexpr unsigned extensions = 2;
  if (format == "spz") {
    const std::string unzipped = beginning.starts_with("NGSP") ? "" : unzipped_beginning(beginning);
    const std::string_view header = unzipped.empty() ? beginning : std::string_view(unzipped);
    return header.size() > flags && (static_cast<unsigned char>(header[flags]) & extensions) == 0 ? "RUB" : "";
  }
  if (format == "gltf" || format == "glb") return "LUF";
  return "";
}

}  // namespace

SceneFileFacts facts_of_scene_file(const std::string& path) {
  SceneFileFacts out;
  std::vector<std::byte> bytes(kSceneBeginning);
  {
    const auto file = open_regular(path);
    bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
  }
  const std::string_view beginning = letters_of(bytes);
  out.format = &read_format(path, bytes);
  // A compressed PLY begins as every PLY does.
  const std::string_view header = beginning.substr(0, beginning.find("end_header"));
  if (out.format->name == "ply" && header.find(" packed_position") != std::string_view::npos)
    out.format = &scene_format("compressed-ply");
  out.version = version_of(out.format->name, beginning);
  out.axes = axes_of_format(out.format->name, beginning);
  out.bytes = std::filesystem::file_size(path);
  return out;
}

}  // namespace vsplat

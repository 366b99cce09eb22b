#include "model/io/foreign_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "runtime/printable.h"

namespace vsplat {
namespace {

using namespace std::string_view_literals;

// The file name, for a command that the user may copy.
std::string name_in_command(const std::string& path) {
  return shell_word(std::filesystem::path(path).filename().string());
}

std::string lower_ending(const std::string& path) {
  std::string out = std::filesystem::path(path).extension().string();
  std::transform(out.begin(), out.end(), out.begin(), [](unsigned char c) { return std::tolower(c); });
  return out;
}

ForeignFile other_scene(const std::string& path, const std::string& name) {
  return {name + ", which is not read", how_to_convert_scene(path)};
}

ForeignFile other_picture(const std::string& path, const std::string& name, const std::string& tool) {
  std::string to = std::filesystem::path(path).stem().string();
  to += lower_ending(path) == ".png" ? "-converted.png" : ".png";
  return {name + ", which is not read",
          fmt::format("convert it: {} {} {}", tool, name_in_command(path), name_in_command(to))};
}

ForeignFile other_mesh(const std::string& path, const std::string& name) {
  return {name + ", a mesh", fmt::format("vsplat dataset render {} draws it", name_in_command(path))};
}

ForeignFile video(const std::string& path, const std::string& kind) {
  return {fmt::format("a video ({})", kind),
          fmt::format("take pictures out of it: ffmpeg -i {} -r 2 %04d.png", name_in_command(path))};
}

bool has_text(std::string_view begin, std::string_view text) { return begin.find(text) != begin.npos; }

// ISO media files (HEIC, AVIF, video), identified by their brand.
std::optional<ForeignFile> media_kind(const std::string& path, std::string_view begin) {
  // A text may have these letters there, too, but no size of a box, which is far below 2^24.
  if (begin.size() < 12 || begin[0] != '\0' || begin.substr(4, 4) != "ftyp") return std::nullopt;
  const std::string_view brand = begin.substr(8, 4);
  if (brand == "avif" || brand == "avis") return other_picture(path, "an AVIF picture", "avifdec");
  for (const std::string_view one : {"heic"sv, "heix"sv, "heim"sv, "heis"sv, "hevc"sv, "hevx"sv, "mif1"sv, "msf1"sv})
    if (brand == one)
      return has_text(begin.substr(0, 64), "avif")
                 ? other_picture(path, "an AVIF picture", "avifdec")
                 : other_picture(path, "a HEIC picture, as phones take them", "heif-convert");
  if (brand == "crx "sv) return other_picture(path, "a camera's raw picture (CR3)", "darktable-cli");
  return video(path, "MP4 or MOV");
}

std::optional<ForeignFile> archive_kind(const std::string& path, std::string_view begin) {
  if (begin.starts_with("PK\x03\x04")) {
    if (lower_ending(path) == ".sog" || has_text(begin, "meta.json") || has_text(begin, "means_l.webp"))
      return ForeignFile{"a SOG file of Gaussians"};
    if (has_text(begin, "data.pkl") || has_text(begin, "/byteorder"))
      return ForeignFile{"a PyTorch checkpoint (a model)", "vsplat weights import reads it"};
    if (has_text(begin, ".npy")) return ForeignFile{"an archive of NumPy arrays (npz)"};
    return ForeignFile{"a zip archive", "unpack it and give its content"};
  }
  if (begin.starts_with("\x1f\x8b")) {
    if (lower_ending(path) == ".spz") return ForeignFile{"an SPZ file of Gaussians"};
    return ForeignFile{"a gzip file", "unpack it with gunzip"};
  }
  if (begin.starts_with("7z\xbc\xaf") || begin.starts_with("Rar!") || begin.starts_with("BZh"))
    return ForeignFile{"an archive", "unpack it and give its content"};
  return std::nullopt;
}

std::optional<ForeignFile> text_kind(const std::string& path, std::string_view begin) {
  const std::size_t first = begin.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  if (first == begin.npos) return std::nullopt;
  const std::string_view from = begin.substr(first);
  if (from.starts_with("version https://git-lfs"))
    return ForeignFile{"a pointer of Git LFS instead of the file itself", "fetch the file: git lfs pull"};
  if (from.starts_with("<!") || from.starts_with("<html") || from.starts_with("<HTML"))
    return ForeignFile{"a web page", "the download returned a page instead of the file"};
  if (from.starts_with("<?xml") || from.starts_with("<svg")) return ForeignFile{"XML or SVG"};
  if (from.starts_with("{") || from.starts_with("[")) {
    if (has_text(begin, "\"means\"") && has_text(begin, "\"mins\"")) return ForeignFile{"the meta.json of a SOG scene"};
    if (has_text(begin, "\"lodLevels\""))
      return ForeignFile{"the index of a streamed SOG scene, which is not read",
                         "give the meta.json of one of its parts, which lie in folders beside it"};
    if (lower_ending(path) == ".lcc") return other_scene(path, "an LCC file of Gaussians");
    if (has_text(begin, "\"asset\"") && has_text(begin, "\"version\"")) return other_mesh(path, "a glTF file");
    if (has_text(begin, "\"frames\"") || has_text(begin, "\"w2c\"") || has_text(begin, "\"camera_angle_x\"") ||
        has_text(begin, "\"rotation\""))
      return ForeignFile{"a list of cameras (JSON)", "give the scene, and this list as the cameras"};
    return ForeignFile{"a JSON file"};
  }
  return std::nullopt;
}

std::optional<ForeignFile> by_beginning(const std::string& path, std::string_view begin) {
  if (const auto found = media_kind(path, begin)) return found;
  if (const auto found = archive_kind(path, begin)) return found;
  if (begin.starts_with("NGSP")) return ForeignFile{"an SPZ file of Gaussians"};
  if (begin.starts_with("RAD0"))
    return ForeignFile{"a RAD file of Gaussians, which is not read", "save the scene as PLY or SPZ instead"};
  if (begin.starts_with("glTF"))
    return has_text(begin, "KHR_gaussian_splatting") ? ForeignFile{"a glTF file of Gaussians"}
                                                     : other_mesh(path, "a GLB file");
  if (begin.starts_with("ply\n") || begin.starts_with("ply\r\n")) return ForeignFile{"a PLY file"};
  if (begin.starts_with("\x89PNG")) return ForeignFile{"a PNG picture"};
  if (begin.starts_with("\xff\xd8\xff")) return ForeignFile{"a JPEG picture"};
  if (begin.starts_with("\x76\x2f\x31\x01")) return ForeignFile{"an EXR picture"};
  if (begin.starts_with("RIFF") && begin.size() >= 12 && begin.substr(8, 4) == "WEBP")
    return ForeignFile{"a WebP picture"};
  if (begin.starts_with("II*\0"sv) || begin.starts_with("MM\0*"sv))
    return ForeignFile{"a TIFF or a camera's raw picture"};
  if (begin.starts_with("GIF8")) return other_picture(path, "a GIF picture", "convert");
  if (begin.starts_with("\xff\x0a") || begin.starts_with("\0\0\0\x0cJXL "sv))
    return other_picture(path, "a JPEG XL picture", "djxl");
  if (begin.starts_with("\0\0\0\x0cjP  "sv)) return other_picture(path, "a JPEG 2000 picture", "opj_decompress");
  if (begin.starts_with("\xabKTX")) return other_picture(path, "a KTX texture", "ktx extract");
  if (begin.starts_with("DDS ")) return other_picture(path, "a DDS texture", "convert");
  if (begin.starts_with("8BPS")) return other_picture(path, "a Photoshop picture (PSD)", "convert");
  if (begin.starts_with("#?RADIANCE") || begin.starts_with("#?RGBE"))
    return other_picture(path, "a Radiance HDR picture", "convert");
  if (begin.size() > 2 && begin[0] == 'P' && begin[1] >= '1' && begin[1] <= '7' &&
      std::isspace(static_cast<unsigned char>(begin[2])))
    return other_picture(path, "a PNM picture", "convert");
  if (begin.starts_with("FUJIFILM")) return other_picture(path, "a camera's raw picture (RAF)", "darktable-cli");
  if (begin.starts_with("%PDF")) return ForeignFile{"a PDF"};
  if (begin.starts_with("\x1a\x45\xdf\xa3")) return video(path, "WebM or MKV");
  if (begin.starts_with("RIFF") && begin.size() >= 12 && begin.substr(8, 4) == "AVI ") return video(path, "AVI");
  if (begin.starts_with("SQLite format 3")) return ForeignFile{"a database, as COLMAP's features are kept in"};
  if (begin.starts_with("BM") && lower_ending(path) == ".bmp") return ForeignFile{"a BMP picture"};
  if (begin.starts_with("\x89HDF\r\n")) return ForeignFile{"an HDF5 file"};
  if (begin.starts_with("\x93NUMPY")) return ForeignFile{"a NumPy array"};
  if (begin.starts_with("\x80\x02") || begin.starts_with("\x80\x04")) return ForeignFile{"a Python pickle"};
  if (begin.size() > 9 && begin[8] == '{' && has_text(begin.substr(0, 64), "\""))
    return ForeignFile{"a safetensors file (a model)"};
  return text_kind(path, begin);
}

std::optional<ForeignFile> by_ending(const std::string& path) {
  const std::string ending = lower_ending(path);
  if (ending == ".spz") return ForeignFile{"an SPZ file of Gaussians by its ending"};
  if (ending == ".splat") return ForeignFile{"a .splat file of Gaussians"};
  if (ending == ".ksplat") return other_scene(path, "a .ksplat file of Gaussians");
  if (ending == ".sog") return ForeignFile{"a SOG file of Gaussians by its ending"};
  if (ending == ".lcc" || ending == ".lcc2") return other_scene(path, "an LCC file of Gaussians");
  if (ending == ".obj" || ending == ".stl") return other_mesh(path, ending == ".obj" ? "an OBJ file" : "an STL file");
  if (ending == ".tga") return other_picture(path, "a TGA picture", "convert");
  return std::nullopt;
}

}  // namespace

std::string how_to_convert_scene(const std::string& path) {
  std::string stem = std::filesystem::path(path).stem().string();
  if (lower_ending(stem) == ".compressed") stem = std::filesystem::path(stem).stem().string();
  if (lower_ending(path) == ".ply" && std::filesystem::path(path).stem().string() == stem) stem += "-standard";
  return fmt::format("convert it with PlayCanvas's splat-transform: splat-transform {} {}", name_in_command(path),
                     name_in_command(stem + ".ply"));
}

std::string ForeignFile::where(const std::string& expected) const {
  return fmt::format("{} where {} is expected{}{}", name, expected, advice.empty() ? "" : "; ", advice);
}

std::optional<ForeignFile> what_file_is(const std::string& path, std::string_view begin) {
  const std::string_view part = begin.substr(0, 4096);
  if (begin.empty()) return ForeignFile{"an empty file"};
  if (auto found = by_beginning(path, part)) return found;
  return by_ending(path);
}

}  // namespace vsplat

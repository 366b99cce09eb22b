// What is fuzzed: each target hands bytes to a reader as the file it would read. A reader may refuse them with
// vsplat::Error, in words fit for a terminal; whatever it takes must be usable. Everything else is a defect, and throws
// something else.
#pragma once
#include <string>
#include <string_view>

#include "runtime/error.h"

namespace vsplat::fuzz {

void ply(std::string_view bytes);
// PNG, JPEG, TIFF, WebP and BMP: the content tells them apart. (EXR is left to OpenEXR's own fuzzers.)
void picture(std::string_view bytes);
// transforms.json and both kinds of cameras.json: the content tells them apart.
void views_json(std::string_view bytes);
// A COLMAP model: "b" or "t" for binary or text, the file of cameras, kColmapSplit, the file of images.
void colmap(std::string_view bytes);
inline constexpr std::string_view kColmapSplit = "=images=";
// Its points: "b" or "t", the file of points.
void colmap_points(std::string_view bytes);

// A file in memory, which readers open by its path.
class MemoryFile {
 public:
  MemoryFile();
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  const std::string& path() const { return path_; }
  void fill(std::string_view bytes);

 private:
  int descriptor_;
  std::string path_;
};

void hold(bool condition, const char* what);
// Of an error that came up while `path` was read.
void hold_message(const Error& error, const std::string& path);

}  // namespace vsplat::fuzz

// What is fuzzed: each target hands bytes to a reader as the file it would read. A reader may refuse them with
// vsplat::Error, in words fit for a terminal; whatever it takes must be usable. Everything else is a defect, and throws
// something else.
#pragma once
#include <string>
#include <string_view>

#include "runtime/error.h"

namespace vsplat::fuzz {

void ply(std::string_view bytes);
// One for each format, as the content tells it: mutations of all in one would stay with those that are the easiest.
void picture_bmp(std::string_view bytes);
void picture_exr(std::string_view bytes);
void picture_jpeg(std::string_view bytes);
void picture_png(std::string_view bytes);
void picture_tiff(std::string_view bytes);
void picture_webp(std::string_view bytes);
// transforms.json and both kinds of cameras.json: the content tells them apart.
void views_json(std::string_view bytes);
// A COLMAP model: "b" or "t" for binary or text, the file of cameras, kColmapSplit, the file of images.
void colmap(std::string_view bytes);
inline constexpr std::string_view kColmapSplit = "=images=";
// Its points: "b" or "t", the file of points.
void colmap_points(std::string_view bytes);
// A training's configuration, and the model's in it.
void train_config(std::string_view bytes);
// Indices of voxels.
void selection(std::string_view bytes);
// Files of tensors: a model, a training's checkpoint, a refinement's. The hash that they state of themselves is put
// right, where there is one, so that what follows it is reached.
void model(std::string_view bytes);
void checkpoint(std::string_view bytes);
void fit_checkpoint(std::string_view bytes);
// PyTorch's: the pickle in a checkpoint, which its checksum does not keep mutations from there, and all of one.
void pickle(std::string_view bytes);
void torch_file(std::string_view bytes);
// An entry of the compiled kernels' cache: "s" and a payload that is stored, or "f", the file, as it may lie there.
void kernel_cache(std::string_view bytes);

// What the process that reads meshes and HDF5 files says: "m" or "h" for which of them, its messages but for the first.
void reader(std::string_view bytes);

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

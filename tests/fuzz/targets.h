// The fuzz targets: each passes bytes to a reader as the file that it would read. A reader may refuse them with
// vsplat::Error and a message that is safe for a terminal; whatever it accepts must be usable. Anything else is a
// defect and throws another exception.
#pragma once
#include <string>
#include <string_view>

#include "runtime/error.h"

namespace vsplat::fuzz {

// Scenes; a PLY may be a compressed one.
void ply(std::string_view bytes);
void splat(std::string_view bytes);
void spz(std::string_view bytes);
// Scenes as SOG: the archive, whose checksums stop most mutations, and its meta.json; and as glTF or GLB.
void sog(std::string_view bytes);
void sog_meta(std::string_view bytes);
void gltf_splats(std::string_view bytes);
// One target per format, selected by content: mutations in a single target would concentrate on the easiest formats.
void picture_bmp(std::string_view bytes);
void picture_exr(std::string_view bytes);
void picture_jpeg(std::string_view bytes);
void picture_png(std::string_view bytes);
void picture_tiff(std::string_view bytes);
void picture_webp(std::string_view bytes);
// transforms.json and both kinds of cameras.json, distinguished by content.
void views_json(std::string_view bytes);
// A COLMAP model: "b" or "t" for binary or text, the file of cameras, kColmapSplit, the file of images.
void colmap(std::string_view bytes);
inline constexpr std::string_view kColmapSplit = "=images=";
// The points of a COLMAP model: "b" or "t", then the file of points.
void colmap_points(std::string_view bytes);
// A training configuration with its model configuration.
void train_config(std::string_view bytes);
// Voxel indices.
void selection(std::string_view bytes);
// Files of tensors: a model, a training checkpoint, a fit checkpoint. A stated hash is corrected, so that the code
// after its check is reached.
void model(std::string_view bytes);
void checkpoint(std::string_view bytes);
void fit_checkpoint(std::string_view bytes);
// PyTorch files: the pickle of a checkpoint, where no checksum stops mutations, and the complete file.
void pickle(std::string_view bytes);
void torch_file(std::string_view bytes);
// An entry of the cache of compiled kernels: "s" and a payload to store, or "f" and the file as found in the cache.
void kernel_cache(std::string_view bytes);

// Messages of the process that reads meshes and HDF5 files: "m" or "h" for the kind, then all messages except the
// first.
void reader(std::string_view bytes);

// A file in memory that readers open by path.
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
// Checks an error that was thrown while reading `path`.
void hold_message(const Error& error, const std::string& path);

}  // namespace vsplat::fuzz

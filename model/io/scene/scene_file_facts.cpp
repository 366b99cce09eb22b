#include "model/io/scene/scene_file_facts.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "model/io/scene/compressed_ply.h"
#include "model/io/scene/gltf_splats.h"
#include "model/io/scene/ply_file.h"
#include "model/io/scene/spz_container.h"
#include "runtime/files/file.h"

namespace vsplat {
namespace {

// A PLY's version, and whether it is a compressed one, which begins as every PLY does.
void describe_ply(const std::string& path, SceneFileFacts& out) {
  PlyFile file(path);
  const PlyHeader header = read_ply_header(file);
  out.version = header.version;
  if (is_compressed_ply(header)) out.format = &scene_format("compressed-ply");
}

}  // namespace

SceneFileFacts facts_of_scene_file(const std::string& path) {
  SceneFileFacts out;
  std::vector<std::byte> bytes(kSceneBeginning);
  {
    const auto file = open_regular(path);
    bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
  }
  out.format = &read_format(path, bytes);
  const std::string_view format = out.format->name;
  if (format == "ply") describe_ply(path, out);
  if (format == "spz") {
    const SpzBeginning beginning = spz_beginning(path, bytes);
    out.version = fmt::format("version {}", beginning.version);
    out.axes = beginning.extensions ? "" : "RUB";
  }
  if (format == "glb") out.version = fmt::format("version {}", glb_version(bytes));
  if (format == "glb" || format == "gltf") out.axes = "LUF";
  out.bytes = std::filesystem::file_size(path);
  return out;
}

}  // namespace vsplat

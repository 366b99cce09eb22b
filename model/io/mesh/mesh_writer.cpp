#include "model/io/mesh/mesh_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "model/io/any_case.h"
#include "model/io/picture/image_file.h"
#include "runtime/fail.h"
#include "runtime/files/output_file.h"

namespace vsplat {
namespace {

using nlohmann::json;

constexpr std::size_t kRowsAtATime = 65536;

// The bytes of values in a row, in little-endian order.
class Bytes {
 public:
  template <class T>
  void put(T value) {
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof value);
    std::memcpy(&bytes_[at], &value, sizeof value);
  }
  void write(OutputFile& file) {
    file.write(bytes_.data(), bytes_.size());
    bytes_.clear();
  }

 private:
  std::vector<unsigned char> bytes_;
};

// Calls `put` for each of `count` rows, and writes what it has put.
template <class Put>
void write_rows(OutputFile& file, std::size_t count, const Put& put) {
  Bytes rows;
  for (std::size_t i = 0; i < count; ++i) {
    put(rows, i);
    if (i % kRowsAtATime == kRowsAtATime - 1) rows.write(file);
  }
  rows.write(file);
}

template <class T>
T rounded(float value, float most) {
  return static_cast<T>(std::lround(std::clamp(value, 0.0f, 1.0f) * most));
}

void write_ply_mesh(const std::string& path, const SurfaceMesh& mesh) {
  const bool far = !mesh.offset.isZero(0);
  const char* number = far ? "double" : "float";
  OutputFile file(path);
  file.write(
      fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {0}\nproperty {2} x\nproperty {2} y\n"
                  "property {2} z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n"
                  "property uchar green\nproperty uchar blue\nelement face {1}\n"
                  "property list uchar int vertex_indices\nend_header\n",
                  mesh.vertex_count(), mesh.triangle_count(), number));
  write_rows(file, mesh.vertex_count(), [&](Bytes& row, std::size_t i) {
    for (std::size_t c = 0; c < 3; ++c)
      if (far)
        row.put(mesh.positions[3 * i + c] + mesh.offset[static_cast<Eigen::Index>(c)]);
      else
        row.put(mesh.positions[3 * i + c]);
    for (std::size_t c = 0; c < 3; ++c) row.put(mesh.normals[3 * i + c]);
    for (std::size_t c = 0; c < 3; ++c) row.put(rounded<std::uint8_t>(mesh.colours[3 * i + c], 255));
  });
  write_rows(file, mesh.triangle_count(), [&](Bytes& row, std::size_t t) {
    row.put(std::uint8_t{3});
    for (std::size_t c = 0; c < 3; ++c) row.put(mesh.triangles[3 * t + c]);
  });
  file.commit();
}

struct GlbPart {
  const char* type;
  int component, target;
  std::size_t count, bytes;  // elements, and of one
};

json glb_document(const SurfaceMesh& mesh, const std::array<GlbPart, 4>& parts) {
  json out;
  out["asset"] = {{"version", "2.0"}, {"generator", "vsplat"}};
  out["extensionsUsed"] = {"KHR_materials_unlit"};
  out["scene"] = 0;
  out["scenes"] = {{{"nodes", {0}}}};
  json node = {{"mesh", 0}};
  if (!mesh.offset.isZero(0)) node["translation"] = {-mesh.offset.x(), -mesh.offset.y(), mesh.offset.z()};
  out["nodes"] = json::array({node});
  std::size_t at = 0;
  for (const GlbPart& p : parts) {
    out["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", at}, {"byteLength", p.count * p.bytes}, {"target", p.target}});
    out["accessors"].push_back({{"bufferView", out["accessors"].size()},
                                {"componentType", p.component},
                                {"count", p.count},
                                {"type", p.type}});
    at += p.count * p.bytes;
  }
  std::array<float, 3> low, high;
  low.fill(std::numeric_limits<float>::max());
  high.fill(std::numeric_limits<float>::lowest());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const float value = i % 3 == 2 ? mesh.positions[i] : -mesh.positions[i];
    low[i % 3] = std::min(low[i % 3], value);
    high[i % 3] = std::max(high[i % 3], value);
  }
  out["accessors"][0]["min"] = low;
  out["accessors"][0]["max"] = high;
  out["accessors"][2]["normalized"] = true;
  out["meshes"] = {{{"primitives", json::array({{{"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"COLOR_0", 2}}},
                                                 {"indices", 3},
                                                 {"material", 0}}})}}};
  out["materials"] = json::array({{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                                   {"doubleSided", true},
                                   {"extensions", {{"KHR_materials_unlit", json::object()}}}}});
  out["buffers"] = {{{"byteLength", at}}};
  return out;
}

void write_glb_mesh(const std::string& path, const SurfaceMesh& mesh) {
  constexpr int kFloat = 5126, kShort = 5123, kWord = 5125, kVertices = 34962, kIndices = 34963;
  const std::size_t vertices = mesh.vertex_count();
  const std::array<GlbPart, 4> parts{GlbPart{"VEC3", kFloat, kVertices, vertices, 12},
                                     {"VEC3", kFloat, kVertices, vertices, 12},
                                     {"VEC4", kShort, kVertices, vertices, 8},
                                     {"SCALAR", kWord, kIndices, mesh.triangles.size(), 4}};
  const json document = glb_document(mesh, parts);
  const std::size_t bytes = document["buffers"][0]["byteLength"];
  std::string text = document.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t whole = 12 + 8 + text.size() + 8 + bytes;
  if (whole > std::numeric_limits<std::uint32_t>::max())
    fail(Status::input, "{}: {} triangles take {} bytes: a GLB has at most 4 GiB; write .ply", path,
         mesh.triangle_count(), whole);
  OutputFile file(path);
  const auto word = [](std::size_t value) { return static_cast<std::uint32_t>(value); };
  Bytes head;
  for (const std::uint32_t value : {0x46546C67u, 2u, word(whole), word(text.size()), 0x4E4F534Au}) head.put(value);
  head.write(file);
  file.write(text);
  for (const std::uint32_t value : {word(bytes), 0x004E4942u}) head.put(value);
  head.write(file);
  for (const std::vector<float>* values : {&mesh.positions, &mesh.normals})
    write_rows(file, vertices, [&](Bytes& row, std::size_t i) {
      for (std::size_t c = 0; c < 3; ++c) row.put(c == 2 ? (*values)[3 * i + c] : -(*values)[3 * i + c]);
    });
  write_rows(file, vertices, [&](Bytes& row, std::size_t i) {
    for (std::size_t c = 0; c < 3; ++c) row.put(rounded<std::uint16_t>(srgb_decode(mesh.colours[3 * i + c]), 65535));
    row.put(std::uint16_t{65535});
  });
  write_rows(file, mesh.triangles.size(), [&](Bytes& row, std::size_t i) { row.put(mesh.triangles[i]); });
  file.commit();
}

std::string ending_of(const std::string& path) { return lower_case(std::filesystem::path(path).extension().string()); }

}  // namespace

bool is_mesh_name(const std::string& path) { return ending_of(path) == ".ply" || ending_of(path) == ".glb"; }

void write_mesh(const std::string& path, const SurfaceMesh& mesh) {
  if (!is_mesh_name(path)) fail(Status::usage, "{}: a mesh is written to a name that ends in .glb or .ply", path);
  if (ending_of(path) == ".ply")
    write_ply_mesh(path, mesh);
  else
    write_glb_mesh(path, mesh);
}

}  // namespace vsplat

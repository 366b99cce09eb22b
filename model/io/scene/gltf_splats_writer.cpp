#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "model/io/scene/gltf_splats.h"
#include "model/io/scene/scene_notes.h"
#include "model/io/scene/written_gaussians.h"
#include "runtime/fail.h"
#include "runtime/files/base64.h"
#include "runtime/files/output_file.h"

namespace vsplat {
namespace {

using nlohmann::json;

constexpr int kFloat = 5126, kByte = 5121;
constexpr std::size_t kGltfRows = 65536;  // Gaussians converted at a time
const std::string kPrefix = "KHR_gaussian_splatting:";

// One attribute: an accessor and a part of the buffer.
struct GltfColumn {
  std::string name;
  const char* type;
  int component;
  std::size_t width, bytes;  // numbers and bytes of an element
  std::function<void(std::size_t k, std::uint8_t* to)> put;
};

void put_floats(std::uint8_t* to, std::initializer_list<float> values) {
  std::memcpy(to, values.begin(), values.size() * sizeof(float));
}

double linear_light(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

// In glTF's axes: a half turn about z changes the signs of x and y, and of coefficients of odd order.
std::vector<GltfColumn> columns_of(const Gaussians& g) {
  std::vector<GltfColumn> out;
  const std::size_t sh_count = g.sh_count();
  out.push_back({"POSITION", "VEC3", kFloat, 3, 12, [&g](std::size_t k, std::uint8_t* to) {
                   put_floats(to, {-g.means[3 * k], -g.means[3 * k + 1], g.means[3 * k + 2]});
                 }});
  out.push_back({"COLOR_0", "VEC4", kByte, 4, 4, [&g, sh_count](std::size_t k, std::uint8_t* to) {
                   for (std::size_t c = 0; c < 3; ++c) {
                     const double colour = 0.5 + kShC0 * static_cast<double>(g.sh[3 * k * sh_count + c]);
                     to[c] = to_byte(255 * linear_light(std::clamp(colour, 0.0, 1.0)));
                   }
                   to[3] = to_byte(255.0 * g.opacities[k]);
                 }});
  out.push_back({kPrefix + "ROTATION", "VEC4", kFloat, 4, 16, [&g](std::size_t k, std::uint8_t* to) {
                   const float* q = &g.quats[4 * k];
                   const double squared = static_cast<double>(q[0]) * q[0] + static_cast<double>(q[1]) * q[1] +
                                          static_cast<double>(q[2]) * q[2] + static_cast<double>(q[3]) * q[3];
                   if (std::abs(squared - 1) < 1e-6) {  // every bit is kept
                     put_floats(to, {-q[1], -q[2], q[3], q[0]});
                     return;
                   }
                   const UnitQuaternion unit(q);
                   put_floats(to, {static_cast<float>(-unit.at[1]), static_cast<float>(-unit.at[2]),
                                   static_cast<float>(unit.at[3]), static_cast<float>(unit.at[0])});
                 }});
  out.push_back({kPrefix + "SCALE", "VEC3", kFloat, 3, 12,
                 [&g](std::size_t k, std::uint8_t* to) { std::memcpy(to, &g.scales[3 * k], 12); }});
  out.push_back({kPrefix + "OPACITY", "SCALAR", kFloat, 1, 4,
                 [&g](std::size_t k, std::uint8_t* to) { std::memcpy(to, &g.opacities[k], 4); }});
  std::size_t i = 0;
  for (int degree = 0; degree <= std::min(g.sh_degree, 3); ++degree)
    for (int order = -degree; order <= degree; ++order, ++i)
      out.push_back({fmt::format("{}SH_DEGREE_{}_COEF_{}", kPrefix, degree, order + degree), "VEC3", kFloat, 3, 12,
                     [&g, sh_count, i, sign = order % 2 == 0 ? 1.0f : -1.0f](std::size_t k, std::uint8_t* to) {
                       const float* sh = &g.sh[3 * (k * sh_count + i)];
                       put_floats(to, {sign * sh[0], sign * sh[1], sign * sh[2]});
                     }});
  return out;
}

std::size_t buffer_bytes(const Gaussians& g, const std::vector<GltfColumn>& columns) {
  std::size_t out = 0;
  for (const GltfColumn& c : columns) out += c.bytes * g.count;
  return out;
}

json document_of(const Scene& scene, const Gaussians& g, const std::vector<GltfColumn>& columns) {
  json out;
  out["asset"] = {{"version", "2.0"}, {"generator", "vsplat"}};
  out["extensionsUsed"] = {"KHR_gaussian_splatting"};
  out["scene"] = 0;
  out["scenes"] = {{{"nodes", {0}}}};
  out["nodes"] = {{{"mesh", 0}}};
  json attributes;
  std::size_t at = 0;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const GltfColumn& c = columns[i];
    attributes[c.name] = i;
    out["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", at}, {"byteLength", c.bytes * g.count}, {"target", 34962}});
    json accessor = {{"bufferView", i}, {"componentType", c.component}, {"count", g.count}, {"type", c.type}};
    if (c.component == kByte) accessor["normalized"] = true;
    if (i == 0) {  // positions need their bounds
      std::array<float, 3> low, high, p;
      low.fill(std::numeric_limits<float>::max());
      high.fill(std::numeric_limits<float>::lowest());
      for (std::size_t k = 0; k < g.count; ++k) {
        c.put(k, reinterpret_cast<std::uint8_t*>(p.data()));
        for (std::size_t axis = 0; axis < 3; ++axis) {
          low[axis] = std::min(low[axis], p[axis]);
          high[axis] = std::max(high[axis], p[axis]);
        }
      }
      accessor["min"] = low;
      accessor["max"] = high;
    }
    out["accessors"].push_back(accessor);
    at += c.bytes * g.count;
  }
  const json extension = {{"kernel", "ellipse"},
                          {"colorSpace", "srgb_rec709_display"},
                          {"projection", "perspective"},
                          {"sortingMethod", "cameraDistance"}};
  json primitive = {{"mode", 0}, {"attributes", attributes}};
  primitive["extensions"]["KHR_gaussian_splatting"] = extension;
  out["meshes"] = {{{"primitives", json::array({primitive})}}};
  out["buffers"] = {{{"byteLength", at}}};
  out["extras"]["vsplat"] = notes_of(scene);
  if (scene.antialias) out["extras"]["vsplat"]["antialias"] = true;
  return out;
}

// Calls `take` with the buffer's bytes in pieces.
template <class Take>
void make_buffer(const Gaussians& g, const std::vector<GltfColumn>& columns, const Take& take) {
  std::vector<std::uint8_t> piece;
  for (const GltfColumn& c : columns)
    for (std::size_t first = 0; first < g.count; first += kGltfRows) {
      const std::size_t count = std::min(kGltfRows, g.count - first);
      piece.resize(count * c.bytes);
      for (std::size_t i = 0; i < count; ++i) c.put(first + i, &piece[i * c.bytes]);
      take(piece);
    }
}

std::string word(std::size_t v) {
  std::string out;
  for (int i = 0; i < 4; ++i) out += static_cast<char>(v >> 8 * i & 255);
  return out;
}

}  // namespace

void write_gltf_scene(const std::string& path, const Scene& scene) {
  Gaussians made;
  const Gaussians& g = volumes_to_write(path, scene.gaussians, made);
  const std::vector<GltfColumn> columns = columns_of(g);
  json document = document_of(scene, g, columns);
  const std::string mark = "data:application/octet-stream;base64,";
  document["buffers"][0]["uri"] = mark;
  const std::string text = document.dump();
  const std::size_t at = text.find(mark) + mark.size();
  OutputFile file(path);
  file.write(text.substr(0, at));
  std::vector<unsigned char> left;  // bytes that make no whole group yet
  make_buffer(g, columns, [&](const std::vector<std::uint8_t>& piece) {
    left.insert(left.end(), piece.begin(), piece.end());
    const std::size_t whole = left.size() / 3 * 3;
    file.write(base64({left.begin(), left.begin() + static_cast<std::ptrdiff_t>(whole)}));
    left.erase(left.begin(), left.begin() + static_cast<std::ptrdiff_t>(whole));
  });
  if (!left.empty()) file.write(base64(left));
  file.write(text.substr(at));
  file.commit();
}

void write_glb_scene(const std::string& path, const Scene& scene) {
  Gaussians made;
  const Gaussians& g = volumes_to_write(path, scene.gaussians, made);
  const std::vector<GltfColumn> columns = columns_of(g);
  std::string text = document_of(scene, g, columns).dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t bytes = buffer_bytes(g, columns), whole = 12 + 8 + text.size() + 8 + bytes;
  if (whole > std::numeric_limits<std::uint32_t>::max())
    fail(Status::input, "{}: {} Gaussians take {} bytes: a GLB has at most 4 GiB; write .gltf or another format", path,
         g.count, whole);
  OutputFile file(path);
  file.write("glTF" + word(2) + word(whole));
  file.write(word(text.size()) + "JSON" + text);
  file.write(word(bytes) + std::string("BIN\0", 4));
  make_buffer(g, columns, [&](const std::vector<std::uint8_t>& piece) { file.write(piece.data(), piece.size()); });
  file.commit();
}

}  // namespace vsplat

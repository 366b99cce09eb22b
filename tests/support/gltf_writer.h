// Writes glTF files for tests, as JSON with a separate buffer or as GLB.
#pragma once
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/temporary.h"

namespace vsplat::test {

// A box of 1 x 0.7 x 0.5; each face shows the whole texture.
struct BoxShape {
  std::vector<float> positions, normals, uv;  // 24 vertices
  std::vector<std::uint16_t> indices;

  BoxShape() {
    const float half[3] = {0.5f, 0.35f, 0.25f};
    for (int axis = 0; axis < 3; ++axis)
      for (const int side : {-1, 1}) {
        const auto first = static_cast<std::uint16_t>(positions.size() / 3);
        for (int corner = 0; corner < 4; ++corner) {
          const int u = corner == 1 || corner == 2, v = corner >= 2;
          float p[3], n[3] = {};
          const int a = (axis + 1) % 3, b = (axis + 2) % 3;
          p[axis] = static_cast<float>(side) * half[axis];
          p[a] = (2 * (side > 0 ? u : 1 - u) - 1) * half[a];
          p[b] = (2 * v - 1) * half[b];
          n[axis] = static_cast<float>(side);
          positions.insert(positions.end(), p, p + 3);
          normals.insert(normals.end(), n, n + 3);
          uv.insert(uv.end(), {static_cast<float>(u), static_cast<float>(1 - v)});
        }
        for (const int i : {0, 1, 2, 0, 2, 3}) indices.push_back(static_cast<std::uint16_t>(first + i));
      }
  }
};

class GltfWriter {
 public:
  nlohmann::json json = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}};

  // Adds an element and returns its index.
  int view(const void* data, std::size_t bytes) {
    while (data_.size() % 4 != 0) data_.push_back(0);
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", data_.size()}, {"byteLength", bytes}});
    data_.append(static_cast<const char*>(data), bytes);
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }
  template <class T>
  int view(const std::vector<T>& values) {
    return view(values.data(), values.size() * sizeof(T));
  }
  int accessor(int view, std::size_t count, int component, const std::string& type, bool normalized = false) {
    nlohmann::json one = {{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}};
    if (normalized) one["normalized"] = true;
    json["accessors"].push_back(one);
    return static_cast<int>(json["accessors"].size()) - 1;
  }
  int floats(const std::vector<float>& values, int width) {
    static const char* const types[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    const std::size_t count = values.size() / static_cast<std::size_t>(width == 16 ? 16 : width);
    return accessor(view(values), count, 5126, width == 16 ? "MAT4" : types[width]);
  }
  // Rows of `width` small numbers; each row is padded to a multiple of four bytes.
  template <class T>
  int packed(const std::vector<T>& values, int width, int component, const std::string& type, bool normalized) {
    std::string bytes;
    for (std::size_t i = 0; i < values.size(); i += static_cast<std::size_t>(width)) {
      bytes.append(reinterpret_cast<const char*>(&values[i]), static_cast<std::size_t>(width) * sizeof(T));
      while (bytes.size() % 4 != 0) bytes.push_back(0);
    }
    const std::size_t count = values.size() / static_cast<std::size_t>(width);
    const int at = view(bytes.data(), bytes.size());
    json["bufferViews"][static_cast<std::size_t>(at)]["byteStride"] = bytes.size() / count;
    return accessor(at, count, component, type, normalized);
  }
  // An embedded picture, and a texture of it.
  int texture(const std::string& file, const std::string& mime) {
    const std::string bytes = contents_of(file);
    json["images"].push_back({{"bufferView", view(bytes.data(), bytes.size())}, {"mimeType", mime}});
    json["textures"].push_back({{"source", json["images"].size() - 1}});
    return static_cast<int>(json["textures"].size()) - 1;
  }
  nlohmann::json& primitive() { return json["meshes"][0]["primitives"][0]; }
  nlohmann::json& attributes() { return primitive()["attributes"]; }
  nlohmann::json& base_colour() { return json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]; }

  // A node with the box, textured with the picture.
  static GltfWriter box(const BoxShape& shape, const std::string& picture) {
    GltfWriter out;
    out.json["nodes"] = {{{"mesh", 0}}};
    out.attributes() = {{"POSITION", out.floats(shape.positions, 3)},
                        {"NORMAL", out.floats(shape.normals, 3)},
                        {"TEXCOORD_0", out.floats(shape.uv, 2)}};
    out.primitive()["indices"] = out.accessor(out.view(shape.indices), shape.indices.size(), 5123, "SCALAR");
    out.primitive()["material"] = 0;
    out.base_colour() = {{"index", out.texture(picture, "image/png")}};
    return out;
  }

  void write_gltf(const std::string& path, const std::string& buffer_uri, const std::string& buffer_path) const {
    put_file(buffer_path, data_);
    put_file(path, with_buffer({{"uri", buffer_uri}, {"byteLength", data_.size()}}).dump());
  }
  void write_glb(const std::string& path) {
    while (data_.size() % 4 != 0) data_.push_back(0);
    std::string text = with_buffer({{"byteLength", data_.size()}}).dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string out = "glTF";
    const auto number = [&](std::size_t value) {
      const auto word = static_cast<std::uint32_t>(value);
      out.append(reinterpret_cast<const char*>(&word), 4);
    };
    number(2), number(28 + text.size() + data_.size());
    number(text.size()), number(0x4e4f534a), out += text;
    number(data_.size()), number(0x004e4942), out += data_;
    put_file(path, out);
  }

 private:
  // The JSON with this buffer as its first.
  nlohmann::json with_buffer(const nlohmann::json& first) const {
    nlohmann::json out = json, all = nlohmann::json::array();
    all.push_back(first);
    if (json.contains("buffers"))
      for (const nlohmann::json& other : json["buffers"]) all.push_back(other);
    out["buffers"] = all;
    return out;
  }

  std::string data_;
};

}  // namespace vsplat::test

// glTF files: whatever an exporter does to a box, the pictures equal those of the plain box, or the file is refused by
// name.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "model/base/image.h"
#include "model/data/mesh_file.h"
#include "model/data/ray_tracer.h"
#include "model/io/picture/image_file.h"
#include "model/views/orbit.h"
#include "tests/support/drawn_mesh.h"
#include "tests/support/gltf_writer.h"
#include "tests/support/picture_writers.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::BoxShape;
using test::expect_error;
using test::GltfWriter;
using test::put_file;

class Gltf : public ::testing::Test {
 protected:
  Gltf() {
    // Asymmetric, with different edges.
    Image picture(48, 32, 3);
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 48; ++x) {
        float* p = picture.at(x, y);
        p[0] = static_cast<float>(x) / 47, p[1] = static_cast<float>(y) / 31,
        p[2] = (x / 6 + y / 9) % 3 == 0 ? 1 : 0.2f;
      }
    write_png(path("paint.png"), picture);
    picture_ = picture;
  }
  std::string path(const std::string& name = "a.glb") const { return folder_ / name; }
  GltfWriter box() const { return GltfWriter::box(shape_, path("paint.png")); }
  std::vector<Image> drawn(GltfWriter writer) const {
    writer.write_glb(path());
    return test::drawn(path());
  }
  void expect_plain(const GltfWriter& writer, const std::string& what) const {
    EXPECT_GE(test::psnr(drawn(writer), drawn(box())), 50) << what;
  }
  // Expects a refusal whose message contains these words.
  void expect_refused(GltfWriter writer, const std::vector<std::string>& words, Status status = Status::format) const {
    writer.write_glb(path());
    std::vector<std::string> all = words;
    all.push_back(path());
    expect_error(status, all, [&] { load_mesh(path()); });
  }

  test::TemporaryFolder folder_;
  test::Warnings warnings_;
  BoxShape shape_;
  Image picture_;
};

template <class T>
std::vector<T> quantised(const std::vector<float>& values, double scale) {
  std::vector<T> out;
  for (const float v : values) out.push_back(static_cast<T>(std::lround(static_cast<double>(v) * scale)));
  return out;
}

TEST_F(Gltf, PlainBoxShowsItsTexture) {
  const std::vector<Image> plain = drawn(box());
  GltfWriter bare = box();
  bare.json.erase("materials");
  bare.primitive().erase("material");
  EXPECT_LT(test::psnr(drawn(bare), plain), 20) << "the comparison sees the texture";
}

TEST_F(Gltf, NormalisedAndQuantisedNumbers) {
  GltfWriter a = box();
  a.attributes()["TEXCOORD_0"] = a.packed(quantised<std::uint16_t>(shape_.uv, 65535), 2, 5123, "VEC2", true);
  expect_plain(a, "texture coordinates of 16 bits");
  GltfWriter b = box();
  b.attributes()["TEXCOORD_0"] = b.packed(quantised<std::uint8_t>(shape_.uv, 255), 2, 5121, "VEC2", true);
  b.attributes()["NORMAL"] = b.packed(quantised<std::int8_t>(shape_.normals, 127), 3, 5120, "VEC3", true);
  expect_plain(b, "of 8 bits, and normals");
  // Scaled back by the node, as quantising programs write it; -32768 counts like -32767 as -1.
  GltfWriter c = box();
  c.attributes()["POSITION"] = c.packed(quantised<std::int16_t>(shape_.positions, 2 * 32767), 3, 5122, "VEC3", true);
  c.json["nodes"][0]["scale"] = {0.5, 0.5, 0.5};
  c.json["extensionsUsed"] = c.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  expect_plain(c, "positions of 16 bits");
  GltfWriter d = box();
  d.attributes()["POSITION"] = d.packed(quantised<std::int16_t>(shape_.positions, 20000), 3, 5122, "VEC3", false);
  d.json["nodes"][0]["scale"] = {1 / 20000.0, 1 / 20000.0, 1 / 20000.0};
  expect_plain(d, "positions as whole numbers");
}

// The texture coordinates that the transform maps to those given.
std::vector<float> undone(const std::vector<float>& uv, const Eigen::Vector2d& offset, double angle,
                          const Eigen::Vector2d& scale) {
  std::vector<float> out;
  Eigen::Matrix2d turn;
  turn << std::cos(angle), std::sin(angle), -std::sin(angle), std::cos(angle);
  for (std::size_t i = 0; i < uv.size(); i += 2) {
    const Eigen::Vector2d from = turn.inverse() * (Eigen::Vector2d(uv[i], uv[i + 1]) - offset);
    for (int c = 0; c < 2; ++c) out.push_back(static_cast<float>(from[c] / scale[c]));
  }
  return out;
}

TEST_F(Gltf, TextureTransforms) {
  struct Case {
    Eigen::Vector2d offset;
    double angle;
    Eigen::Vector2d scale;
  };
  for (const Case& one : {Case{{0.25, 0.5}, 0, {1, 1}}, Case{{0, 0}, 0, {0.5, 2}}, Case{{0.1, -0.3}, 0.7, {3, -0.4}}}) {
    GltfWriter writer = box();
    writer.attributes()["TEXCOORD_0"] = writer.floats(undone(shape_.uv, one.offset, one.angle, one.scale), 2);
    writer.base_colour()["extensions"]["KHR_texture_transform"] = {{"offset", {one.offset.x(), one.offset.y()}},
                                                                   {"rotation", one.angle},
                                                                   {"scale", {one.scale.x(), one.scale.y()}}};
    expect_plain(writer, fmt::format("rotation {}", one.angle));
  }
  GltfWriter other = box();  // the transform's own texture coordinates
  const int right = other.floats(shape_.uv, 2), wrong = other.floats(std::vector<float>(shape_.uv.size(), 0.3f), 2);
  other.attributes()["TEXCOORD_0"] = wrong, other.attributes()["TEXCOORD_2"] = right;
  other.base_colour()["texCoord"] = 0;
  other.base_colour()["extensions"]["KHR_texture_transform"] = {{"texCoord", 2}};
  expect_plain(other, "texCoord of the transform");
}

TEST_F(Gltf, OtherTextureCoordinates) {
  GltfWriter both = box();
  both.attributes()["TEXCOORD_1"] = both.attributes()["TEXCOORD_0"];
  both.attributes()["TEXCOORD_0"] = both.floats(std::vector<float>(shape_.uv.size(), 0.3f), 2);
  both.base_colour()["texCoord"] = 1;
  expect_plain(both, "the second of two");
  GltfWriter alone = both;
  alone.attributes().erase("TEXCOORD_0");
  expect_plain(alone, "the second alone");
  GltfWriter none = box();
  none.base_colour()["texCoord"] = 3;
  expect_refused(none, {"texture coordinates"}, Status::input);
}

// Compares with the picture laid out three by three according to the sampler, with coordinates inside it.
TEST_F(Gltf, SamplersWrap) {
  const std::vector<float> far = undone(shape_.uv, {1.0 / 3, 1.0 / 3}, 0, {1.0 / 3, 1.0 / 3});  // -1 to 2
  const std::tuple<int, int, bool> modes[] = {{33071, 33648, false}, {33648, 10497, false}, {10497, 33071, true}};
  for (const auto& [u, v, nearest] : modes) {
    const int w = picture_.width, h = picture_.height;
    Image wide(3 * w, 3 * h, 3);
    const auto place = [](int at, int size, int mode) {
      const int i = at - size;  // of -size to 2 size
      if (mode == 33071) return std::clamp(i, 0, size - 1);
      if (mode == 33648 && (i < 0 || i >= size)) return size - 1 - (i + size) % size;
      return (i + size) % size;
    };
    for (int y = 0; y < 3 * h; ++y)
      for (int x = 0; x < 3 * w; ++x) std::copy_n(picture_.at(place(x, w, u), place(y, h, v)), 3, wide.at(x, y));
    write_png(path("wide.png"), wide);
    GltfWriter clean = GltfWriter::box(shape_, path("wide.png")), wrapped = box();
    wrapped.attributes()["TEXCOORD_0"] = wrapped.floats(far, 2);
    wrapped.json["samplers"] = {{{"wrapS", u}, {"wrapT", v}}};
    wrapped.json["textures"][0]["sampler"] = 0;
    // Beyond the nine tiles: a mirror begins with the texel that it ends with, as clamping does.
    const auto outside = [](int mode) { return mode == 10497 ? 10497 : 33071; };
    clean.json["samplers"] = {{{"wrapS", outside(u)}, {"wrapT", outside(v)}}};
    clean.json["textures"][0]["sampler"] = 0;
    if (nearest) wrapped.json["samplers"][0]["magFilter"] = clean.json["samplers"][0]["magFilter"] = 9728;
    EXPECT_GE(test::psnr(drawn(wrapped), drawn(clean)), 50) << u << ' ' << v;
    wrapped.json["textures"][0].erase("sampler");
    EXPECT_LT(test::psnr(drawn(wrapped), drawn(clean)), 30) << "the sampler counts";
  }
  GltfWriter bad = box();
  bad.json["samplers"] = {{{"wrapS", 7}}};
  bad.json["textures"][0]["sampler"] = 0;
  expect_refused(bad, {"samplers[0].wrapS", "is 7"});
}

TEST_F(Gltf, WebpTextures) {
  std::vector<std::uint8_t> bytes;
  for (const float v : picture_.data) bytes.push_back(static_cast<std::uint8_t>(std::lround(255 * v)));
  test::write_test_webp(path("paint.webp"), picture_.width, picture_.height, 3, bytes);
  write_png(path("grey.png"), Image(4, 4, 3, 0.5f));
  GltfWriter alone = GltfWriter::box(shape_, path("paint.webp"));
  alone.json["images"][0]["mimeType"] = "image/webp";
  expect_plain(alone, "as the plain source");
  alone.json["textures"][0] = {{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}};
  alone.json["extensionsUsed"] = alone.json["extensionsRequired"] = {"EXT_texture_webp"};
  expect_plain(alone, "by the extension");
  GltfWriter both = alone;
  both.texture(path("grey.png"), "image/png");
  both.json["textures"][0]["source"] = 1;
  expect_plain(both, "before the one for other programs");
  GltfWriter basis = alone;
  basis.json.erase("extensionsRequired");
  basis.json["textures"][0] = {{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}};
  expect_refused(basis, {"KHR_texture_basisu", "textures[0]"}, Status::input);
  basis.primitive().erase("material");
  basis.write_glb(path());
  EXPECT_EQ(load_mesh(path()).triangles(), 12u) << "of what is not drawn nothing is asked";
}

// A buffer view packed by meshoptimizer, which replaces the accessor's view.
void pack(GltfWriter& writer, int accessor, const std::string& mode, std::size_t stride, std::size_t count,
          const std::vector<unsigned char>& packed) {
  const int view = writer.view(packed);
  json& old = writer.json["bufferViews"][writer.json["accessors"][accessor]["bufferView"].get<std::size_t>()];
  const json part = writer.json["bufferViews"][static_cast<std::size_t>(view)];
  writer.json["bufferViews"].erase(static_cast<std::size_t>(view));
  old = {{"buffer", 1}, {"byteOffset", 0}, {"byteLength", stride * count}};
  if (mode == "ATTRIBUTES") old["byteStride"] = stride;
  old["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                  {"byteOffset", part["byteOffset"]},
                                                  {"byteLength", packed.size()},
                                                  {"byteStride", stride},
                                                  {"count", count},
                                                  {"mode", mode}};
}

TEST_F(Gltf, MeshoptCompression) {
  GltfWriter writer = box();
  const auto attribute = [&](const char* name, const std::vector<float>& values, std::size_t width) {
    const std::size_t count = values.size() / width, stride = width * sizeof(float);
    std::vector<unsigned char> packed(meshopt_encodeVertexBufferBound(count, stride));
    packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), values.data(), count, stride));
    pack(writer, writer.attributes()[name].get<int>(), "ATTRIBUTES", stride, count, packed);
  };
  attribute("POSITION", shape_.positions, 3);
  attribute("NORMAL", shape_.normals, 3);
  attribute("TEXCOORD_0", shape_.uv, 2);
  const std::size_t corners = shape_.indices.size();
  std::vector<unsigned char> packed(meshopt_encodeIndexBufferBound(corners, 24));
  meshopt_encodeIndexVersion(1);
  packed.resize(meshopt_encodeIndexBuffer(packed.data(), packed.size(), shape_.indices.data(), corners));
  pack(writer, writer.primitive()["indices"].get<int>(), "TRIANGLES", 2, corners, packed);
  writer.json["buffers"] = {
      {{"byteLength", 1000}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  writer.json["extensionsUsed"] = writer.json["extensionsRequired"] = {"EXT_meshopt_compression"};
  expect_plain(writer, "vertices and indices");

  const auto changed = [&](const char* field, const json& value) {
    GltfWriter bad = writer;
    bad.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"][field] = value;
    return bad;
  };
  const std::string where = "bufferViews[0].extensions.EXT_meshopt_compression";
  expect_refused(changed("mode", "WORDS"), {where + ".mode", "WORDS"});
  expect_refused(changed("byteStride", 6), {where + ".byteStride", "is 6"});
  expect_refused(changed("filter", "OCTAHEDRAL"), {where + ".filter", "OCTAHEDRAL"});
  expect_refused(changed("byteLength", 8), {where, "cannot be decompressed"});
  expect_refused(changed("count", 1'000'000'000), {where, "cannot hold"});
}

TEST_F(Gltf, DracoCompression) {
  draco::TriangleSoupMeshBuilder builder;
  const auto triangles = static_cast<int>(shape_.indices.size() / 3);
  builder.Start(triangles);
  const auto attribute = [&](draco::GeometryAttribute::Type type, const std::vector<float>& values, int width) {
    const int id = builder.AddAttribute(type, static_cast<std::int8_t>(width), draco::DT_FLOAT32);
    for (int t = 0; t < triangles; ++t) {
      const auto at = [&](int k) { return &values[static_cast<std::size_t>(width) * shape_.indices[3 * t + k]]; };
      builder.SetAttributeValuesForFace(id, draco::FaceIndex(static_cast<std::uint32_t>(t)), at(0), at(1), at(2));
    }
    return id;
  };
  const int position = attribute(draco::GeometryAttribute::POSITION, shape_.positions, 3);
  const int normal = attribute(draco::GeometryAttribute::NORMAL, shape_.normals, 3);
  const int uv = attribute(draco::GeometryAttribute::TEX_COORD, shape_.uv, 2);
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  ASSERT_TRUE(mesh);
  draco::Encoder encoder;
  draco::EncoderBuffer buffer;
  ASSERT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
  GltfWriter writer = box();
  for (json& accessor : writer.json["accessors"]) accessor.erase("bufferView");
  writer.json["accessors"][0]["count"] = mesh->num_points();
  writer.primitive()["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", writer.view(buffer.data(), buffer.size())},
      {"attributes", {{"POSITION", position}, {"NORMAL", normal}, {"TEXCOORD_0", uv}}}};
  writer.json["extensionsUsed"] = writer.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  expect_plain(writer, "Draco");
  std::string cut(buffer.data(), buffer.size() / 2);
  writer.primitive()["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = writer.view(cut.data(), cut.size());
  expect_refused(writer, {"meshes[0].primitives[0].extensions.KHR_draco_mesh_compression", "cannot be decompressed"});
}

TEST_F(Gltf, NamesOfFiles) {
  GltfWriter writer = box();
  std::filesystem::create_directory(path("my textures"));
  std::filesystem::copy(path("paint.png"), path("my textures/base colour #1.png"));
  writer.json["images"][0] = {{"uri", "my%20textures/base%20colour%20%231.png"}};
  writer.write_gltf(path("a.gltf"), "my%20data.bin", path("my data.bin"));
  const std::vector<Image> plain = drawn(box());
  EXPECT_GE(test::psnr(test::drawn(path("a.gltf")), plain), 50) << "percent-encoded";
  std::filesystem::rename(path("my textures/base colour #1.png"), path("100%25.png"));
  writer.json["images"][0] = {{"uri", "100%25.png"}};
  writer.write_gltf(path("a.gltf"), "my data.bin", path("my data.bin"));
  EXPECT_GE(test::psnr(test::drawn(path("a.gltf")), plain), 50) << "not encoded";
  writer.json["images"][0] = {{"uri", "https://example.org/a.png"}};
  writer.write_gltf(path("a.gltf"), "my data.bin", path("my data.bin"));
  expect_error(Status::format, {path("a.gltf"), "images[0].uri", "network"}, [&] { load_mesh(path("a.gltf")); });
  writer.json["images"][0] = {{"uri", "100%25.png"}};
  // Files are found with the same search as the pictures of a list.
  for (const auto& [picture, buffer] : {std::pair{"Paint.PNG", "MY%20DATA.BIN"},
                                        {"C:%5Cme%5Cpaint.png", "C:\\me\\my data.bin"},
                                        {"textures/paint.jpg", "../x/my%20data.bin"}}) {
    writer.json["images"][0] = {{"uri", picture}};
    writer.write_gltf(path("a.gltf"), buffer, path("my data.bin"));
    EXPECT_GE(test::psnr(test::drawn(path("a.gltf")), plain), 50) << picture << ", " << buffer;
  }
  writer.write_gltf(path("a.gltf"), "gone.bin", path("my data.bin"));
  expect_error(Status::input, {path("a.gltf"), "buffers[0].uri", "gone.bin"}, [&] { load_mesh(path("a.gltf")); });
}

TEST_F(Gltf, ExtensionsThatAreUsedAndNotReadAreReported) {
  GltfWriter writer = box();
  writer.json["extensionsUsed"] = {"KHR_texture_transform", "KHR_materials_unlit", "KHR_texture_basisu"};
  expect_plain(writer, "known, or with a picture that stands in");
  EXPECT_EQ(warnings_.text(), "");
  writer.json["extensionsUsed"].push_back("KHR_materials_transmission");
  expect_plain(writer, "drawn all the same");
  EXPECT_NE(warnings_.text().find("KHR_materials_transmission"), std::string::npos) << warnings_.text();
}

}  // namespace
}  // namespace vsplat

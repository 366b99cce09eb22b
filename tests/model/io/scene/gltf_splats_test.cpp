// glTF with KHR_gaussian_splatting: files of tests/golden/gltf_files.py, round trips, and damage.
#include "model/io/scene/gltf_splats.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>

#include "runtime/files/base64.h"
#include "tests/support/golden_file.h"
#include "tests/support/refusal.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using nlohmann::json;

const std::string kPrefix = "KHR_gaussian_splatting:";

Scene read_bytes(const std::string& name, const std::string& bytes, SkippedGaussians* skipped = nullptr) {
  return read_gltf_scene(name, std::as_bytes(std::span(bytes)), skipped);
}

Scene read_path(const std::string& path) { return read_gltf_file(path); }

Eigen::Vector3d vector_of(const json& v) { return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()}; }

void expect_file(const std::string& file) {
  SCOPED_TRACE(file);
  const std::filesystem::path path = test::golden_file("gltf/" + file);
  const json expected = json::parse(test::contents_of(std::filesystem::path(path).replace_extension(".json").string()));
  const Scene scene = read_path(path.string());
  const Gaussians& g = scene.gaussians;
  ASSERT_EQ(g.count, expected["mean"].size());
  ASSERT_EQ(g.sh_degree, expected["degree"].get<int>());
  for (std::size_t k = 0; k < g.count; ++k) {
    SCOPED_TRACE(k);
    const Eigen::Quaterniond q(g.quats[4 * k], g.quats[4 * k + 1], g.quats[4 * k + 2], g.quats[4 * k + 3]);
    const Eigen::Vector3d s(g.scales[3 * k], g.scales[3 * k + 1], g.scales[3 * k + 2]);
    const Eigen::Matrix3d rs = q.toRotationMatrix() * s.asDiagonal(), covariance = rs * rs.transpose();
    const Eigen::Vector3d mean = vector_of(expected["mean"][k]);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(g.means[3 * k + static_cast<std::size_t>(i)], mean[i], 1e-5);
      const Eigen::Vector3d row = vector_of(expected["covariance"][k][static_cast<std::size_t>(i)]);
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(covariance(i, j), row[j], 1e-5);
    }
    EXPECT_NEAR(g.opacities[k], expected["opacity"][k].get<double>(), 1e-6);
    for (std::size_t d = 0; d < expected["directions"].size(); ++d) {
      const Eigen::VectorXd basis = sh_basis(g.sh_degree, vector_of(expected["directions"][d]));
      for (std::size_t c = 0; c < 3; ++c) {
        double colour = 0.5;
        for (std::size_t i = 0; i < g.sh_count(); ++i)
          colour += basis[static_cast<Eigen::Index>(i)] * g.sh[3 * (k * g.sh_count() + i) + c];
        EXPECT_NEAR(colour, expected["colour"][k][d][c].get<double>(), 1e-5) << d;
      }
    }
  }
}

TEST(GltfSplats, ReadsOthersFiles) {
  expect_file("plain.glb");
  expect_file("turned.gltf");
  expect_file("beside.gltf");
  // Files of the current folder are not those of a scene in memory.
  const std::string bytes = test::contents_of(test::golden_file("gltf/beside.gltf"));
  test::expect_error(Status::format, {"a scene", "buffers[0].uri", "in memory"}, [&] { read_bytes("a scene", bytes); });
}

TEST(GltfSplats, TheBufferIsFoundByTheSearchForListedFiles) {
  const test::TemporaryFolder folder;
  json j = json::parse(test::contents_of(test::golden_file("gltf/beside.gltf")));
  test::put_file(folder / "ka\u0308se.bin", test::contents_of(test::golden_file("gltf/beside it.bin")));
  for (const char* name : {"k\u00e4se.bin", "k%C3%A4se.BIN", "scene/K\u00e4se.bin"}) {
    j["buffers"][0]["uri"] = name;
    test::put_file(folder / "a.gltf", j.dump());
    EXPECT_NO_THROW(read_path(folder / "a.gltf")) << name;
  }
  test::put_file(folder / "other.png", "no buffer");
  j["buffers"][0]["uri"] = "other.bin";
  test::put_file(folder / "a.gltf", j.dump());
  test::expect_error(Status::format, {"a.gltf", "other.bin"}, [&] { read_path(folder / "a.gltf"); });
}

class GltfSplatsWriter : public ::testing::Test {
 protected:
  test::TemporaryFolder folder_;
};

TEST_F(GltfSplatsWriter, KeepsEveryBit) {
  for (const int degree : {0, 1, 2, 3}) {
    Scene scene;
    scene.gaussians = test::make_scene({"", 257, degree, 0, 0, ""}, 3);
    scene.near = 0.125f;
    scene.up = {{0, -1, 0}};
    scene.offset = {1e6, 0, 0.1};
    scene.antialias = degree == 1;
    write_glb_scene(folder_ / "a.glb", scene);
    write_gltf_scene(folder_ / "a.gltf", scene);
    for (const char* name : {"a.glb", "a.gltf"}) {
      SCOPED_TRACE(name);
      const Scene back = read_path(folder_ / name);
      const Gaussians &a = scene.gaussians, &b = back.gaussians;
      EXPECT_EQ(a.means, b.means);
      EXPECT_EQ(a.scales, b.scales);
      EXPECT_EQ(a.quats, b.quats);
      EXPECT_EQ(a.opacities, b.opacities);
      EXPECT_EQ(a.sh, b.sh);
      EXPECT_EQ(back.near, scene.near);
      EXPECT_EQ(back.up, scene.up);
      EXPECT_EQ(back.offset, scene.offset);
      EXPECT_EQ(back.antialias, scene.antialias);
    }
  }
}

json json_of_glb(const std::string& glb) {
  std::uint32_t bytes = 0;
  std::memcpy(&bytes, &glb[12], 4);
  return json::parse(glb.substr(20, bytes));
}

// y and x change their signs, z stays; the fallback's colour is linear: half of sRGB is 0.214 of the light.
TEST_F(GltfSplatsWriter, WritesWhatTheSpecificationAsksFor) {
  Scene scene;
  Gaussians& g = scene.gaussians;
  g.count = 2;
  g.means = {1, 2, 3, -4, 5, -6};
  g.scales = {0.5f, 0.25f, 2, 1, 1, 1};
  g.quats = {1, 0, 0, 0, 0.5f, 0.5f, -0.5f, 0.5f};
  g.opacities = {1, 0.2f};
  g.sh = {0, 0, 0, 10, -10, 0};
  write_glb_scene(folder_ / "a.glb", scene);
  const std::string glb = test::contents_of(folder_ / "a.glb");
  std::uint32_t words[3];
  std::memcpy(words, glb.data(), 12);
  EXPECT_EQ(words[2], glb.size());
  const json j = json_of_glb(glb);
  const json& primitive = j["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 0);
  EXPECT_EQ(primitive["extensions"]["KHR_gaussian_splatting"]["kernel"], "ellipse");
  EXPECT_EQ(j["extensionsUsed"], json({"KHR_gaussian_splatting"}));
  const json& position = j["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
  EXPECT_EQ(position["min"], json({-1, -5, -6}));
  EXPECT_EQ(position["max"], json({4, -2, 3}));
  const auto data = [&](const std::string& attribute) {
    const json& accessor = j["accessors"][primitive["attributes"][attribute].get<std::size_t>()];
    const json& view = j["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    return glb.substr(
        glb.size() - j["buffers"][0]["byteLength"].get<std::size_t>() + view["byteOffset"].get<std::size_t>(),
        view["byteLength"].get<std::size_t>());
  };
  EXPECT_EQ(data("COLOR_0"), std::string("\x37\x37\x37\xff\xff\x00\x37\x33", 8));
  const auto floats = [](const std::vector<float>& v) {
    return std::string(reinterpret_cast<const char*>(v.data()), 4 * v.size());
  };
  EXPECT_EQ(data("POSITION"), floats({-1, -2, 3, 4, -5, -6}));
  EXPECT_EQ(data(kPrefix + "ROTATION"), floats({-0.0f, -0.0f, 0, 1, -0.5f, 0.5f, 0.5f, 0.5f}));
  EXPECT_EQ(data(kPrefix + "SCALE"), floats(g.scales));
  EXPECT_EQ(data(kPrefix + "OPACITY"), floats(g.opacities));
}

TEST_F(GltfSplatsWriter, AFailedWriteKeepsTheOldFile) {
  Scene scene;
  scene.gaussians = test::make_scene({"", 3, 0, 0, 0, ""}, 1);
  scene.gaussians.opacities[2] = 2;
  for (const auto write : {write_glb_scene, write_gltf_scene}) {
    test::put_file(folder_ / "a", "old");
    test::expect_error(Status::input, {"Gaussian 2", "opacity"}, [&] { write(folder_ / "a", scene); });
    EXPECT_EQ(test::contents_of(folder_ / "a"), "old");
    EXPECT_EQ(folder_.entries().size(), 1u);
  }
}

// turned.gltf with other JSON, as a file in memory.
std::string changed(const std::function<void(json&)>& edit) {
  json j = json::parse(test::contents_of(test::golden_file("gltf/turned.gltf")));
  edit(j);
  return j.dump();
}

void expect_refused(const std::function<void(json&)>& edit, std::vector<std::string> words) {
  words.emplace_back("a.gltf");
  test::expect_error(Status::format, words, [&] { read_bytes("a.gltf", changed(edit)); });
}

json& attributes(json& j) { return j["meshes"][0]["primitives"][0]["attributes"]; }

TEST(GltfDamage, NamesTheField) {
  EXPECT_NO_THROW(read_bytes("a.gltf", changed([](json&) {})));
  expect_refused([](json& j) { j["asset"]["version"] = "1.0"; }, {"asset.version", "1.0"});
  expect_refused([](json& j) { j["accessors"][0]["sparse"] = {{"count", 1}}; }, {"accessors[0].sparse"});
  expect_refused([](json& j) { j["accessors"][0].erase("bufferView"); }, {"accessors[0]", "bufferView"});
  expect_refused([](json& j) { j["accessors"][1]["count"] = 1000; }, {"accessors[1].count", "1000"});
  expect_refused([](json& j) { j["accessors"][1]["count"] = 4; }, {"ROTATION", "4", "5"});
  expect_refused([](json& j) { j["accessors"][0]["count"] = 4294967296u; }, {"accessors[0].count", "4294967296"});
  expect_refused([](json& j) { j["accessors"][0]["count"] = 18446744073709551615u; }, {"accessors[0].count"});
  expect_refused([](json& j) { j["accessors"][0]["type"] = "VEC2"; }, {"accessors[0].type", "VEC2"});
  expect_refused([](json& j) { j["accessors"][0]["componentType"] = 5124; }, {"accessors[0].componentType"});
  expect_refused([](json& j) { j["bufferViews"][0]["byteLength"] = 1u << 30; }, {"bufferViews[0]"});
  expect_refused([](json& j) { j["bufferViews"][0]["byteStride"] = 4; }, {"bufferViews[0].byteStride"});
  expect_refused([](json& j) { j["buffers"][0].erase("uri"); }, {"buffers[0]", "uri"});
  expect_refused([](json& j) { j["buffers"][0]["uri"] = "../secret.bin"; }, {"buffers[0].uri", "../secret.bin"});
  expect_refused([](json& j) { j["buffers"][0]["uri"] = "%2e%2e/secret.bin"; }, {"buffers[0].uri"});
  expect_refused([](json& j) { j["buffers"][0]["uri"] = "none.bin"; }, {"buffers[0].uri", "none.bin"});
  expect_refused([](json& j) { j["buffers"][0]["uri"] = "data:;base64,AAA"; }, {"buffers[0].uri", "base64"});
  expect_refused([](json& j) { j["buffers"][0]["byteLength"] = 1u << 31; }, {"buffers[0].byteLength"});
  expect_refused([](json& j) { attributes(j).erase(kPrefix + "SCALE"); }, {"SCALE", "missing"});
  expect_refused([](json& j) { attributes(j).erase(kPrefix + "SH_DEGREE_2_COEF_3"); }, {"SH_DEGREE_2_COEF_3"});
  expect_refused([](json& j) { j["meshes"][0]["primitives"][0]["mode"] = 4; }, {"mode", "4"});
  expect_refused([](json& j) { j["meshes"][0]["primitives"][0].erase("extensions"); }, {"KHR_gaussian_splatting"});
  expect_refused(
      [](json& j) {
        auto& e = j["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"];
        e["extensions"]["KHR_gaussian_splatting_compression_spz"] = json::object();
      },
      {"compressed by KHR_gaussian_splatting_compression_spz"});
  expect_refused(
      [](json& j) {
        j["meshes"][0]["primitives"][0]["extensions"] = {{"KHR_spz_gaussian_splats_compression", json::object()}};
        j["extensionsUsed"] = {"KHR_spz_gaussian_splats_compression"};
      },
      {"KHR_spz_gaussian_splats_compression, which is not read"});
  EXPECT_NO_THROW(read_bytes("a.gltf", changed([](json& j) {
                               j["extensionsRequired"] = {"KHR_gaussian_splatting", "KHR_mesh_quantization"};
                               j["extensionsUsed"] = {"KHR_gaussian_splatting", "VENDOR_name"};
                             })));
  expect_refused(
      [](json& j) {
        j["extensionsRequired"] = {"KHR_gaussian_splatting", "VENDOR_turned"};
      },
      {"extensionsRequired[1]", "VENDOR_turned"});
  const auto shown = [](json& j, std::size_t primitives, std::size_t nodes) {
    json& all = j["meshes"][0]["primitives"];
    all = std::vector<json>(primitives, all[0]);
    const std::uint64_t mesh = 0;
    j["nodes"] = std::vector<json>(nodes, {{"mesh", mesh}});
    j["scenes"][0]["nodes"] = json::array();
    for (std::size_t i = 0; i < nodes; ++i) j["scenes"][0]["nodes"].push_back(i);
  };
  const std::size_t each = read_bytes("a.gltf", changed([](json&) {})).gaussians.count;
  EXPECT_EQ(read_bytes("a.gltf", changed([&](json& j) { shown(j, 3, 7); })).gaussians.count, 3 * 7 * each);
  expect_refused([&](json& j) { shown(j, 257, 256); }, {"meshes[0]", "65536 primitives"});
  expect_refused([](json& j) { j["nodes"][1]["scale"] = {1, 2, 1}; }, {"scale evenly"});
  expect_refused([](json& j) { j["nodes"][1]["scale"] = {-1, -1, -1}; }, {"scale evenly"});
  expect_refused([](json& j) { j["nodes"][1]["children"] = {0}; }, {"nodes[1].children[0]", "tree"});
  expect_refused([](json& j) { j["nodes"][0]["children"] = {7}; }, {"nodes[0].children[0]", "7"});
  expect_refused([](json& j) { j["scene"] = 5; }, {"scene", "5"});
}

// One Gaussian of floats, as JSON with its buffer inside.
std::string one_gaussian(float z, float scale, float w, float opacity, bool with_colour = false) {
  const std::vector<float> values = {1, 2, z, 0, 0, 0, w, 1, 1, scale, opacity, 0.25f, 0.25f, 0.25f};
  std::vector<unsigned char> bytes(4 * values.size());
  std::memcpy(bytes.data(), values.data(), bytes.size());
  json j = {{"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", {0}}}}}, {"nodes", {{{"mesh", 0}}}}};
  const std::pair<std::string, std::string> columns[] = {
      {"POSITION", "VEC3"},
      {kPrefix + "ROTATION", "VEC4"},
      {kPrefix + "SCALE", "VEC3"},
      {kPrefix + "OPACITY", "SCALAR"},
      {with_colour ? "COLOR_0" : kPrefix + "SH_DEGREE_0_COEF_0", "VEC3"}};
  json primitive = {{"mode", 0}};
  primitive["extensions"]["KHR_gaussian_splatting"]["kernel"] = "ellipse";
  std::size_t at = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    primitive["attributes"][columns[i].first] = i;
    j["accessors"].push_back(
        {{"bufferView", 0}, {"byteOffset", at}, {"componentType", 5126}, {"count", 1}, {"type", columns[i].second}});
    at += columns[i].second == "VEC3" ? 12 : columns[i].second == "VEC4" ? 16 : 4;
  }
  j["meshes"][0]["primitives"] = json::array({primitive});
  j["bufferViews"] = json::array({{{"buffer", 0}, {"byteLength", bytes.size()}}});
  j["buffers"] = json::array({{{"byteLength", bytes.size()}, {"uri", "data:;base64," + base64(bytes)}}});
  return j.dump();
}

TEST(GltfDamage, GaussiansThatCannotBeDrawnAreNamedOrCounted) {
  const test::Warnings warnings;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  SkippedGaussians skipped;
  const auto expect = [&](const std::string& bytes, const std::vector<std::string>& words) {
    test::expect_error(Status::format, words, [&] { read_bytes("a.gltf", bytes); });
    EXPECT_EQ(read_bytes("a.gltf", bytes, &skipped).gaussians.count, 0u);
    EXPECT_EQ(skipped.total(), 1u);
  };
  expect(one_gaussian(nan, 1, 1, 1), {"a.gltf", "Gaussian 0, POSITION 2", "accessors[0]"});
  expect(one_gaussian(0, -1, 1, 1), {"a.gltf", "Gaussian 0, SCALE 2", "-1"});
  expect(one_gaussian(0, 1, 1, nan), {"a.gltf", "Gaussian 0, OPACITY 0"});
  expect(one_gaussian(0, 1, 0, 1), {"a.gltf", "Gaussian 0, ROTATION"});
  EXPECT_EQ(skipped.zero_rotation, 1u);
  const Scene sound = read_bytes("a.gltf", one_gaussian(0, 1, 2, 1), &skipped);
  EXPECT_EQ(skipped.total(), 0u);
  EXPECT_EQ(sound.gaussians.quats[0], 1);
}

// A quarter of the light is 0.537 of sRGB.
TEST(GltfSplats, ColoursReplaceMissingHarmonics) {
  const Gaussians g = read_bytes("a.gltf", one_gaussian(0, 1, 1, 1, true)).gaussians;
  EXPECT_NEAR(0.5 + kShC0 * g.sh[0], 0.5371, 1e-4);
}

TEST(GltfDamage, CutOffAnywhereIsAnError) {
  const std::string sound = test::contents_of(test::golden_file("gltf/plain.glb"));
  for (std::size_t n = 0; n < sound.size(); n += 7)
    test::expect_error(Status::format, {"a.glb"}, [&] { read_bytes("a.glb", sound.substr(0, n)); });
}

}  // namespace
}  // namespace vsplat

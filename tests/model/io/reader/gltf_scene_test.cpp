// The scene of glTF files: nodes, skins, morph targets, instances, and materials beyond the base colour.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "model/io/picture/image_file.h"
#include "tests/support/drawn_mesh.h"
#include "tests/support/gltf_writer.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::BoxShape;
using test::GltfWriter;

class GltfScene : public ::testing::Test {
 protected:
  GltfScene() {
    Image picture(16, 16, 3);
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 16; ++x)
        picture.at(x, y)[0] = static_cast<float>(x) / 15, picture.at(x, y)[1] = static_cast<float>(y) / 15;
    write_png(paint(), picture);
  }
  std::string path() const { return folder_ / "a.glb"; }
  std::string paint() const { return folder_ / "paint.png"; }
  GltfWriter box() const { return GltfWriter::box(shape_, paint()); }
  // The box and a second, moved one, whose position is visible in the picture.
  GltfWriter two(const BoxShape& first) const {
    GltfWriter out = GltfWriter::box(first, paint());
    out.json["meshes"].push_back({{"primitives", {GltfWriter::box(shape_, paint()).primitive()}}});
    out.json["meshes"][1]["primitives"][0]["attributes"]["POSITION"] =
        out.floats(moved(shape_, {0, 0, 1}).positions, 3);
    out.json["nodes"].push_back({{"mesh", 1}});
    out.json["scenes"][0]["nodes"] = {0, 1};
    return out;
  }
  static BoxShape moved(BoxShape shape, const std::array<float, 3>& by, float scale = 1) {
    for (std::size_t i = 0; i < shape.positions.size(); ++i)
      shape.positions[i] = scale * shape.positions[i] + by[i % 3];
    return shape;
  }
  std::vector<Image> drawn(GltfWriter writer) const {
    writer.write_glb(path());
    return test::drawn(path());
  }
  void expect_same(const GltfWriter& a, const GltfWriter& b, const std::string& what) const {
    EXPECT_GE(test::psnr(drawn(a), drawn(b)), 50) << what;
  }
  void expect_refused(GltfWriter writer, const std::vector<std::string>& words, Status status = Status::format) const {
    writer.write_glb(path());
    test::expect_error(status, words, [&] { load_mesh(path()); });
  }

  test::TemporaryFolder folder_;
  test::Warnings warnings_;
  BoxShape shape_;
};

// Attaches each vertex to joint 0 only.
void hang(GltfWriter& writer, std::size_t vertices) {
  std::vector<std::uint8_t> joints(4 * vertices);
  std::vector<float> weights(4 * vertices);
  for (std::size_t i = 0; i < vertices; ++i) weights[4 * i] = 1;
  writer.attributes()["JOINTS_0"] = writer.packed(joints, 4, 5121, "VEC4", false);
  writer.attributes()["WEIGHTS_0"] = writer.floats(weights, 4);
}

TEST_F(GltfScene, SkinsHangOnTheirJoints) {
  GltfWriter skinned = two(shape_);
  hang(skinned, 24);
  skinned.json["nodes"].push_back({{"translation", {0, 1, 0}}});
  skinned.json["scenes"][0]["nodes"].push_back(2);
  const std::vector<float> bind = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.25f, 0, 0, 1};
  skinned.json["skins"] = {{{"joints", {2}}, {"inverseBindMatrices", skinned.floats(bind, 16)}}};
  skinned.json["nodes"][0]["skin"] = 0;
  const GltfWriter clean = two(moved(shape_, {0.25f, 1, 0}));
  expect_same(skinned, clean, "joint and inverse bind matrix");
  skinned.json["nodes"][0]["translation"] = {5, 6, 7};
  skinned.json["nodes"][0]["scale"] = {2, 2, 2};
  expect_same(skinned, clean, "where the node itself stands does not count");
  GltfWriter gone = skinned;
  gone.json["skins"][0]["joints"] = json::array();
  expect_refused(gone, {"JOINTS_0", "uses joint 0"});
  skinned.attributes().erase("WEIGHTS_0");
  expect_refused(skinned, {"meshes[0].primitives[0].attributes", "no WEIGHTS_0"});
}

TEST_F(GltfScene, MorphTargetsCountByTheirWeights) {
  GltfWriter morphed = two(shape_);
  std::vector<float> change(shape_.positions.size());
  for (std::size_t i = 0; i < change.size(); i += 3) change[i] = 2;
  morphed.primitive()["targets"] = {{{"POSITION", morphed.floats(change, 3)}}};
  expect_same(morphed, two(shape_), "of weight 0");
  morphed.json["meshes"][0]["weights"] = {0.25};
  expect_same(morphed, two(moved(shape_, {0.5f, 0, 0})), "the mesh's weights");
  morphed.json["nodes"][0]["weights"] = {-0.5};
  expect_same(morphed, two(moved(shape_, {-1, 0, 0})), "the node's before the mesh's");
}

TEST_F(GltfScene, InstancesAndWhatIsHidden) {
  GltfWriter clean = two(moved(shape_, {1, 0, 0}, 0.5f));
  GltfWriter instanced = box();
  instanced.json["nodes"].push_back({{"mesh", 0}});
  instanced.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"TRANSLATION", instanced.floats({1, 0, 0, 0, 0, 1}, 3)},
      {"SCALE", instanced.floats({0.5, 0.5, 0.5, 1, 1, 1}, 3)}};
  instanced.json["nodes"][1]["extensions"]["KHR_node_visibility"]["visible"] = false;
  instanced.json["scenes"][0]["nodes"] = {0, 1};
  instanced.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing", "KHR_node_visibility"};
  expect_same(instanced, clean, "two instances, and a node that is not seen");
  GltfWriter no_scene = clean;
  no_scene.json.erase("scene"), no_scene.json.erase("scenes");
  expect_same(no_scene, clean, "without scenes, all roots");
}

TEST_F(GltfScene, OtherMaterials) {
  GltfWriter red = box();
  red.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {0.8, 0.1, 0.2, 1}}}}}};
  GltfWriter glossy = box();
  glossy.json["materials"] = {
      {{"extensions", {{"KHR_materials_pbrSpecularGlossiness", {{"diffuseFactor", {0.8, 0.1, 0.2, 1}}}}}}}};
  expect_same(glossy, red, "the diffuse factor");
  glossy.json["materials"][0]["extensions"]["KHR_materials_pbrSpecularGlossiness"] = {
      {"diffuseTexture", {{"index", 0}}}};
  expect_same(glossy, box(), "the diffuse texture");

  // Emission: a black surface appears with its emitted brightness, on every side.
  const auto brightness = [&](const GltfWriter& writer) {
    float most = 0;
    for (const Image& image : drawn(writer))
      for (std::size_t i = 0; i < image.data.size(); i += 4) most = std::max(most, image.data[i]);
    return most;
  };
  GltfWriter glowing = box();
  glowing.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0, 1}}}}}};
  EXPECT_EQ(brightness(glowing), 0);
  glowing.json["materials"][0]["emissiveFactor"] = {0.25, 0, 0};
  EXPECT_NEAR(brightness(glowing), srgb_encode(0.25f), 1e-3);
  glowing.json["materials"][0]["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = 2;
  EXPECT_NEAR(brightness(glowing), srgb_encode(0.5f), 1e-3);
  glowing.json["materials"][0]["emissiveTexture"] = {{"index", 0}};
  std::vector<float> corner(shape_.uv.size());  // of the picture: 0.4 of the way to the right
  for (std::size_t i = 0; i < corner.size(); i += 2) corner[i] = 6.5f / 16, corner[i + 1] = 0.5f;
  glowing.attributes()["TEXCOORD_1"] = glowing.floats(corner, 2);
  glowing.json["materials"][0]["emissiveTexture"]["texCoord"] = 1;
  EXPECT_NEAR(brightness(glowing), srgb_encode(0.5f * srgb_decode(6.0f / 15)), 3e-3);
}

TEST_F(GltfScene, VerticesAlphaMakesHoles) {
  GltfWriter writer = box();
  std::vector<float> colours;
  for (int i = 0; i < 24; ++i) colours.insert(colours.end(), {1, 1, 1, i < 12 ? 0.0f : 1.0f});
  writer.attributes()["COLOR_0"] = writer.floats(colours, 4);
  expect_same(writer, box(), "opaque, whatever the alpha");
  writer.json["materials"][0]["alphaMode"] = "MASK";
  const std::vector<Image> holes = drawn(writer);
  EXPECT_LT(test::psnr(holes, drawn(box())), 30) << "half of the faces are holes";
}

TEST_F(GltfScene, RefusesByName) {
  const auto changed = [&](const std::string& pointer, const json& value) {
    GltfWriter out = box();
    out.json[json::json_pointer(pointer)] = value;
    return out;
  };
  expect_refused(changed("/extensionsRequired", {"KHR_materials_ior", "ACME_voxels"}), {path(), "ACME_voxels"},
                 Status::input);
  expect_refused(changed("/asset/version", "3.0"), {path(), "glTF 3.0"});
  expect_refused(changed("/nodes/0/children", {0}), {"ancestors"});
  expect_refused(changed("/nodes", json::array({{{"children", {1}}}, {{"mesh", 0}}, {{"children", {1}}}})),
                 {"nodes[2].children[0]", "nodes[0]"});
  expect_refused(changed("/nodes/0/mesh", 7), {"nodes[0].mesh", "is 7", "there are 1 meshes"});
  expect_refused(changed("/meshes/0/primitives/0/mode", 9), {"meshes[0].primitives[0].mode"});
  expect_refused(changed("/accessors/0/count", 25), {"accessors[0]", "beyond its buffer view's 288 bytes"});
  expect_refused(changed("/accessors/0/type", "VEC5"), {"accessors[0].type", "VEC5"});
  expect_refused(changed("/accessors/3/componentType", 5126), {"accessors[3].componentType", "indices"});
  expect_refused(changed("/accessors/2/count", 23), {"TEXCOORD_0", "23 elements, there are 24 vertices"});
  expect_refused(changed("/bufferViews/0/byteLength", 1 << 20), {"bufferViews[0]", "beyond the buffer's"});
  expect_refused(changed("/bufferViews/1/byteOffset", -4), {"bufferViews[1].byteOffset", "is -4"});
  expect_refused(changed("/materials/0/alphaMode", "SOLID"), {"materials[0].alphaMode", "SOLID"});
  expect_refused(changed("/meshes/0/primitives/0/attributes/POSITION", json("first")), {"POSITION", "\"first\""});
  expect_refused(changed("/meshes/0/primitives/0/mode", 1), {"no faces"}, Status::input);
}

}  // namespace
}  // namespace vsplat

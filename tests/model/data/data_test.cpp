// Meshes converted to data sets: a textured cube with known pictures, refused input, names, normals, solids.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "model/base/image.h"
#include "model/data/mesh_file.h"
#include "model/data/object_folder.h"
#include "model/data/object_names.h"
#include "model/data/ray_tracer.h"
#include "model/data/solids.h"
#include "model/data/sphere_cameras.h"
#include "model/io/picture/image_file.h"
#include "model/io/views/view_set.h"
#include "model/views/orbit.h"
#include "runtime/error.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using test::expect_error;
using test::put_file;
using test::TemporaryFolder;

// A box from (1,2,3) to (1,2,3) + size: quads without normals, each showing the whole texture.
std::string box_obj(const Vector3d& size, const std::string& head = "mtllib box.mtl\n") {
  std::string out = head;
  for (int i = 0; i < 8; ++i)
    out += fmt::format("v {} {} {}\n", 1 + (i & 1) * size.x(), 2 + (i >> 1 & 1) * size.y(), 3 + (i >> 2) * size.z());
  out += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl paint\n";
  for (const char* face : {"1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"}) {
    int a = 0, b = 0, c = 0, d = 0;
    EXPECT_EQ(std::sscanf(face, "%d %d %d %d", &a, &b, &c, &d), 4);
    out += fmt::format("f {}/1 {}/2 {}/3 {}/4\n", a, b, c, d);
  }
  return out;
}

// Left half red, right half green.
void write_box(const TemporaryFolder& folder, const Vector3d& size = {2, 2, 2}) {
  Image picture(64, 64, 3);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) picture.at(x, y)[x < 32 ? 0 : 1] = 1;
  write_png(folder / "paint.png", picture);
  put_file(folder / "box.mtl", "newmtl paint\nKd 1 1 1\nmap_Kd paint.png\n");
  put_file(folder / "box.obj", box_obj(size));
}

Camera facing(const Vector3d& eye, int size) {
  Camera c;
  c.width = c.height = size;
  c.fx = c.fy = size;
  c.cx = c.cy = 0.5 * size;
  c.w2c = look_at(eye, Vector3d::Zero(), Vector3d(0, 1, 0));
  return c;
}

TEST(MeshFile, FitsATexturedBoxIntoTheCube) {
  const TemporaryFolder folder;
  write_box(folder, {4, 2, 1});
  Mesh mesh = load_mesh(folder / "box.obj");
  ASSERT_EQ(mesh.triangles(), 12u);
  fit_into_cube(mesh);
  Vector3f low = Vector3f::Ones(), high = -Vector3f::Ones();
  for (const Corner& c : mesh.corners) low = low.cwiseMin(c.position), high = high.cwiseMax(c.position);
  EXPECT_TRUE(low.isApprox(Vector3f(-0.5f, -0.25f, -0.125f)) && high.isApprox(Vector3f(0.5f, 0.25f, 0.125f)));
  EXPECT_NEAR(radius_of(mesh), Vector3d(0.5, 0.25, 0.125).norm(), 1e-6);
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) {  // edges stay sharp: normals are those of the faces
    const Corner* c = &mesh.corners[i / 3 * 3];
    const Vector3f face = (c[1].position - c[0].position).cross(c[2].position - c[0].position).normalized();
    EXPECT_LT((mesh.corners[i].normal - face).norm(), 1e-5f) << i;
  }
}

TEST(RayTracer, DrawsTheFaceInSizeColourAndPlace) {
  const TemporaryFolder folder;
  write_box(folder);
  Mesh mesh = load_mesh(folder / "box.obj");
  fit_into_cube(mesh);
  const int size = 101;
  const Image picture = RayTracer(mesh).picture(facing({0, 0, 2.1}, size), 4);
  double area = 0;
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) area += picture.at(x, y)[3];
  const double edge = size / 1.6;  // the nearer face, 1 wide at distance 1.6, hides the rest
  EXPECT_NEAR(area, edge * edge, 0.01 * edge * edge);
  // Light on +z: 0.48 + 0.4 x 0.48 / |(0.36, 0.80, 0.48)|.
  const double light = 0.48 + 0.4 * 0.48 / std::sqrt(0.36 * 0.36 + 0.8 * 0.8 + 0.48 * 0.48);
  const float bright = srgb_encode(static_cast<float>(light));
  const float* left = picture.at(30, 50);  // the face "5 6 8 7" has its texture's left at -x, seen on the left
  const float* right = picture.at(70, 50);
  EXPECT_NEAR(left[0], bright, 1e-3) << "red on the left";
  EXPECT_NEAR(left[1], 0, 1e-3);
  EXPECT_NEAR(right[1], bright, 1e-3) << "green on the right";
  EXPECT_NEAR(right[0], 0, 1e-3);
  EXPECT_EQ(picture.at(2, 2)[3], 0);
  EXPECT_EQ(picture.at(2, 2)[0], 0);
}

// A plate 0.4 in front of another; its texture has alpha 0 on the left and 0.6 on the right.
TEST(RayTracer, SeesThroughHoles) {
  const auto drawn = [](float cutoff) {
    Mesh mesh;
    Image paint(32, 32, 4, 1.0f);
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 32; ++x) {
        paint.at(x, y)[1] = paint.at(x, y)[2] = 0;
        paint.at(x, y)[3] = x < 16 ? 0.0f : 0.6f;
      }
    mesh.palette = {{Vector3f::Ones(), texture_of(paint), 1, cutoff}, {Vector3f(0, 1, 0)}};
    for (int plate = 0; plate < 2; ++plate) {
      const float z = plate == 0 ? 0.2f : -0.2f, half = plate == 0 ? 0.5f : 0.1f;
      for (const auto& corner : std::vector<std::array<int, 2>>{{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}}) {
        Corner c;
        c.uv = {static_cast<float>(corner[0]), static_cast<float>(corner[1])};
        c.position = {half * (2 * c.uv.x() - 1) - 0.2f * static_cast<float>(plate), half * (2 * c.uv.y() - 1), z};
        c.normal = {0, 0, 1};
        mesh.corners.push_back(c);
      }
      mesh.materials.insert(mesh.materials.end(), 2, static_cast<std::uint32_t>(plate));
    }
    return RayTracer(mesh).picture(facing({0, 0, 2}, 64), 2);
  };
  const Image holes = drawn(0.5f), solid = drawn(0), gone = drawn(0.7f);
  const auto is = [](const float* p, float r, float g, float a) {
    return (p[0] > 0) == (r > 0) && (p[1] > 0) == (g > 0) && p[3] == a;
  };
  EXPECT_TRUE(is(holes.at(42, 32), 1, 0, 1)) << "the right half is there";
  EXPECT_TRUE(is(holes.at(26, 32), 0, 1, 1)) << "through the hole, the plate behind";
  EXPECT_TRUE(is(holes.at(24, 46), 0, 0, 0)) << "through the hole, nothing";
  EXPECT_TRUE(is(solid.at(26, 32), 1, 0, 1)) << "without a cut-off alpha says nothing";
  EXPECT_TRUE(is(gone.at(42, 32), 0, 0, 0)) << "0.6 is below 0.7";
}

TEST(MeshFile, TakesTheAlphaOfTextures) {
  const TemporaryFolder folder;
  write_box(folder);
  EXPECT_EQ(load_mesh(folder / "box.obj").palette.at(0).cutoff, 0) << "a picture without alpha";
  write_png(folder / "paint.png", Image(8, 8, 4, 0.25f));
  const Mesh mesh = load_mesh(folder / "box.obj");
  const auto textured =
      std::find_if(mesh.palette.begin(), mesh.palette.end(), [](const Material& m) { return m.texture != nullptr; });
  ASSERT_NE(textured, mesh.palette.end());
  EXPECT_EQ(textured->cutoff, 0.5f);
  EXPECT_NEAR(sample_alpha(*textured->texture, {0.3f, 0.3f}), 0.25, 0.01);
  for (const Material& m : load_mesh(folder / "box.obj", folder / "paint.png").palette)
    EXPECT_EQ(m.cutoff, 0) << "--texture covers all of it";

  const auto gltf = [&](const std::string& alpha) {
    put_file(folder / "leaf.bin",
             std::string("\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3f\0\0\0\0", 36));
    put_file(
        folder / "leaf.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
      "buffers":[{"uri":"leaf.bin","byteLength":36}],"bufferViews":[{"buffer":0,"byteLength":36}],
      "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
      "materials":[{)" + alpha + R"("pbrMetallicRoughness":{"baseColorFactor":[1,1,1,0.4]}}],
      "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}]})");
    const Mesh leaf = load_mesh(folder / "leaf.gltf");
    return leaf.palette.at(leaf.materials.at(0));
  };
  EXPECT_EQ(gltf("").cutoff, 0) << "opaque, whatever its alpha";
  EXPECT_EQ(gltf(R"("alphaMode":"BLEND",)").cutoff, 0.5f);
  EXPECT_NEAR(gltf(R"("alphaMode":"MASK","alphaCutoff":0.3,)").cutoff, 0.3f, 1e-6f);
  EXPECT_NEAR(gltf(R"("alphaMode":"MASK",)").alpha, 0.4f, 1e-6f);
}

TEST(Texture, IsBilinearAndRepeats) {
  Image two(2, 1, 3);
  two.at(1, 0)[0] = 1;
  const auto texture = texture_of(two);
  EXPECT_NEAR(sample(*texture, {0.25f, 0.5f}).x(), 0, 1e-6);
  EXPECT_NEAR(sample(*texture, {0.75f, 0.5f}).x(), 1, 1e-6);
  EXPECT_NEAR(sample(*texture, {0.5f, 0.3f}).x(), 0.5, 1e-6);
  EXPECT_NEAR(sample(*texture, {0.375f, 7.0f}).x(), 0.25, 1e-6);
  EXPECT_NEAR(sample(*texture, {-1.625f, 0.0f}).x(), 0.25, 1e-6);
}

TEST(SphereCameras, SeeAllOfTheObjectFromAllSides) {
  const double radius = std::sqrt(0.75);
  const std::vector<Camera> cameras = sphere_cameras(40, 96, radius, 3, 1);
  ASSERT_EQ(cameras.size(), 40u);
  Vector3d mean = Vector3d::Zero();
  for (const Camera& c : cameras) {
    mean += c.centre().normalized() / 40;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector4d corner((i & 1) - 0.5, (i >> 1 & 1) - 0.5, (i >> 2) - 0.5, 1);
      const Eigen::Vector4d at = c.w2c * corner;
      EXPECT_GT(at.z(), 0.2);
      for (const double p : {c.fx * at.x() / at.z() + c.cx, c.fy * at.y() / at.z() + c.cy}) {
        EXPECT_GT(p, 0);
        EXPECT_LT(p, 96);
      }
    }
  }
  EXPECT_LT(mean.norm(), 0.1) << "not spread over the sphere";
  for (const Camera& c : sphere_cameras(40, 96, 0.5, 3, 1)) {
    EXPECT_GE(c.centre().norm(), 1.6);
    EXPECT_LE(c.centre().norm(), 1.9);
  }
  EXPECT_EQ(sphere_cameras(40, 96, radius, 3, 1)[7].w2c, cameras[7].w2c);
  EXPECT_NE(sphere_cameras(40, 96, radius, 4, 1)[7].w2c, cameras[7].w2c);
  EXPECT_NE(sphere_cameras(40, 96, radius, 3, 2)[7].w2c, cameras[7].w2c);
  expect_error(Status::usage, {"0 views"}, [&] { sphere_cameras(0, 96, radius, 3, 1); });
  expect_error(Status::usage, {"7 pixels"}, [&] { sphere_cameras(4, 7, radius, 3, 1); });
}

TEST(ObjectFolder, IsReadAsViewsAndWrittenTwiceTheSame) {
  const TemporaryFolder folder;
  write_box(folder);
  ObjectOptions options;
  options.views = 5, options.size = 24, options.seed = 9;
  const Mesh mesh = load_mesh(folder / "box.obj");
  write_object(folder / "set/box", mesh, options);
  write_object(folder / "again", mesh, options);
  for (const std::string& file : object_files("", 5))
    EXPECT_EQ(test::contents_of(folder / "set/box/" + file), test::contents_of(folder / "again/" + file)) << file;
  const ViewSet set = read_views(folder / "set/box");
  ASSERT_EQ(set.views.size(), 5u);
  EXPECT_EQ(set.aabb_center, Vector3d::Zero());
  EXPECT_EQ(set.aabb_half, 0.5);
  const auto cameras = sphere_cameras(5, 24, std::sqrt(0.75), 9, 0);
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(set.views[i].camera.w2c.isApprox(cameras[i].w2c, 1e-5));
    const Image picture = read_image(folder / fmt::format("set/box/images/{:04}.png", i));
    ASSERT_EQ(picture.channels, 4);
    EXPECT_EQ(picture.at(12, 12)[3], 1);
    EXPECT_EQ(picture.at(0, 0)[3], 0);
    EXPECT_NEAR(set.views[i].camera.fx, cameras[i].fx, 1e-9);
  }
}

TEST(ObjectFolder, LeavesNothingWhereItIsStopped) {
  const TemporaryFolder folder;
  ObjectOptions options;
  options.views = 3, options.size = 8;
  options.go = [](double done) { return done < 0.5; };
  expect_error(Status::cancelled, {}, [&] { write_object(folder / "a/b", random_solid(1, 0), options); });
  EXPECT_TRUE(folder.entries().empty());
}

TEST(MeshFile, RefusesWhatCannotBeDrawn) {
  const TemporaryFolder folder;
  write_box(folder);
  const auto refused = [&](const std::string& name, const std::string& content, Status status,
                           const std::string& word) {
    put_file(folder / name, content);
    expect_error(status, {folder / name, word}, [&] {
      Mesh mesh = load_mesh(folder / name);
      fit_into_cube(mesh);
    });
  };
  expect_error(Status::file, {"none.obj"}, [&] { load_mesh(folder / "none.obj"); });
  refused("noise.glb", "no mesh at all", Status::format, "cannot be read");
  refused("empty.obj", "", Status::format, "cannot be read");
  refused("lost.obj", box_obj({2, 2, 2}, "mtllib lost.mtl\n"), Status::input, "lost.mtl");
  put_file(folder / "bare.mtl", "newmtl paint\nmap_Kd gone.png\n");
  refused("bare.obj", box_obj({2, 2, 2}, "mtllib bare.mtl\n"), Status::input, "gone.png");
  refused("point.obj", "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", Status::input, "one point");
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  refused("nan.ply",
          ply + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n",
          Status::input, "finite");
  refused("index.ply",
          ply + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 900\n",
          Status::format, "");
  refused("points.ply", ply + "end_header\n0 0 0\n1 0 0\n0 1 0\n", Status::input, "no faces");
  put_file(folder / "plain.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_EQ(load_mesh(folder / "plain.obj").triangles(), 1u);
  expect_error(Status::input, {"plain.obj", "texture coordinates"},
               [&] { load_mesh(folder / "plain.obj", folder / "paint.png"); });
  EXPECT_EQ(load_mesh(folder / "bare.obj", folder / "paint.png").triangles(), 12u) << "--texture replaces what is gone";
}

TEST(ObjectNames, AreStemsOrFoldersAndDifferent) {
  using Names = std::vector<std::string>;
  EXPECT_EQ(object_names({"a/cup.glb", "b/bowl.obj"}), (Names{"cup", "bowl"}));
  EXPECT_EQ(object_names({"a/model.obj"}), (Names{"a"}));
  EXPECT_EQ(object_names({"a/cup.glb", "b/cup.glb", "dish.ply"}), (Names{"a", "b", "dish"}));
  EXPECT_EQ(object_names({"x/a/model.obj", "y/a/model.obj", "a_2.ply"}), (Names{"a", "a_3", "a_2"}));
}

// Every part is closed: its volume by the divergence theorem does not depend on the origin.
TEST(Solids, AreClosedSmoothAndTheSameForASeed) {
  for (std::uint32_t i = 0; i < 8; ++i) {
    const Mesh mesh = random_solid(2, i);
    EXPECT_GE(mesh.palette.size(), 1u);
    EXPECT_LE(mesh.palette.size(), 4u);
    Vector3d sum = Vector3d::Zero();
    double area = 0;
    std::size_t with_normal = 0;
    for (std::size_t t = 0; t < mesh.triangles(); ++t) {
      const Corner* c = &mesh.corners[3 * t];
      const Vector3d face =
          (c[1].position - c[0].position).cast<double>().cross((c[2].position - c[0].position).cast<double>());
      sum += face;
      area += face.norm();
      for (int k = 0; k < 3; ++k) with_normal += std::abs(c[k].normal.norm() - 1) < 1e-4f ? 1 : 0;
    }
    EXPECT_LT(sum.norm(), 1e-4 * area) << "solid " << i << " has a hole";
    EXPECT_GT(static_cast<double>(with_normal), 0.9 * static_cast<double>(mesh.corners.size())) << i;
    const Mesh again = random_solid(2, i), other = random_solid(3, i);
    EXPECT_EQ(again.corners.back().position, mesh.corners.back().position);
    EXPECT_NE(other.corners.back().position, mesh.corners.back().position);
  }
}

}  // namespace
}  // namespace vsplat

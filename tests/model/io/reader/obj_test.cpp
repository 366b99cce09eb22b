// OBJ, MTL and PLY meshes as programs write them: features that assimp ignores, and concave polygons.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "model/io/picture/image_file.h"
#include "model/io/reader/program/triangulate.h"
#include "tests/support/drawn_mesh.h"
#include "tests/support/gltf_writer.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using test::put_file;

class Obj : public ::testing::Test {
 protected:
  Obj() {
    Image picture(24, 16, 3);
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 24; ++x) {
        float* p = picture.at(x, y);
        p[0] = static_cast<float>(x) / 23, p[1] = static_cast<float>(y) / 15, p[2] = x / 5 % 2 == 0 ? 1 : 0;
      }
    write_png(folder_ / "tex.png", picture);
  }
  std::string path(const std::string& name = "a.obj") const { return folder_ / name; }

  // The box with texture coordinates scale x (u, v) + offset.
  static std::string box(const std::string& head, float scale_u = 1, float scale_v = 1, float du = 0, float dv = 0) {
    const test::BoxShape shape;
    std::string out = head;
    for (std::size_t i = 0; i < 24; ++i)
      out +=
          fmt::format("v {} {} {}\n", shape.positions[3 * i], shape.positions[3 * i + 1], shape.positions[3 * i + 2]);
    for (std::size_t i = 0; i < 24; ++i)
      out += fmt::format("vt {} {}\n", scale_u * shape.uv[2 * i] + du, scale_v * (1 - shape.uv[2 * i + 1]) + dv);
    out += "usemtl m\n";
    for (std::size_t i = 0; i < 36; i += 3)
      out += fmt::format("f {0}/{0} {1}/{1} {2}/{2}\n", shape.indices[i] + 1, shape.indices[i + 1] + 1,
                         shape.indices[i + 2] + 1);
    return out;
  }
  std::vector<Image> drawn(const std::string& mtl, const std::string& obj = box("mtllib a.mtl\n")) const {
    put_file(path("a.mtl"), mtl);
    put_file(path(), obj);
    return test::drawn(path());
  }
  void expect_plain(const std::string& mtl, const std::string& obj = box("mtllib a.mtl\n")) const {
    EXPECT_GE(test::psnr(drawn(mtl, obj), drawn("newmtl m\nKd 1 1 1\nmap_Kd tex.png\n")), 50) << mtl;
  }

  test::TemporaryFolder folder_;
  test::Warnings warnings_;
};

TEST_F(Obj, TextLinesHoweverTheyEnd) {
  EXPECT_LT(test::psnr(drawn("newmtl m\nKd 1 1 1\n"), drawn("newmtl m\nKd 1 1 1\nmap_Kd tex.png\n")), 30);
  expect_plain("newmtl m \nmap_Kd tex.png \t \n");
  expect_plain("\xef\xbb\xbfnewmtl m\nmap_Kd tex.png\n");
  expect_plain("newmtl m\r\nmap_Kd tex.png \r\n");
  expect_plain("newmtl m\rmap_Kd tex.png\r");
  expect_plain("newmtl m # its name\n\tmap_Kd tex.png # the colours\n");
  expect_plain("newmtl m\nmap_Kd \"tex.png\"\n");
  expect_plain("newmtl m\nmap_Kd tex.png");
  expect_plain("newmtl m\nmap_Kd tex.png\n", box("\xef\xbb\xbfmtllib a.mtl  \n"));
  std::string carriage = box("mtllib a.mtl\n");
  std::replace(carriage.begin(), carriage.end(), '\n', '\r');
  expect_plain("newmtl m\nmap_Kd tex.png\n", carriage);
  std::filesystem::copy(path("tex.png"), path("my texture.png"));
  expect_plain("newmtl m\nmap_Kd -s 1 1 1 my texture.png\n");
}

TEST_F(Obj, NumbersOfFortranAreRefused) {
  std::string obj = box("mtllib a.mtl\n");
  const std::string plain = obj;
  obj.replace(obj.find("v -0.5"), 6, "v -5.0D-01");
  put_file(path("a.mtl"), "newmtl m\n");
  put_file(path(), obj);
  test::expect_error(Status::format, {path(), "line ", "-5.0D-01", "a number is expected"}, [&] { load_mesh(path()); });
  expect_plain("newmtl m\nmap_Kd tex.png\n", "# 1.0D+00\n" + plain + "g D 5\n");
}

TEST_F(Obj, OptionsOfTextures) {
  expect_plain("newmtl m\nmap_Kd -blendu on -bm 0.5 -o 0 0 0 -mm 0 1 -s 1 1 1 tex.png\n");
  const auto moved = [&](const std::string& options, float su, float sv, float du, float dv) {
    const std::vector<Image> clean = drawn("newmtl m\nmap_Kd tex.png\n", box("mtllib a.mtl\n", su, sv, du, dv));
    EXPECT_GE(test::psnr(drawn("newmtl m\nmap_Kd " + options + " tex.png\n"), clean), 50) << options;
  };
  moved("-s 2 3 1", 2, 3, 0, 0);
  moved("-s 2 3", 2, 3, 0, 0);
  moved("-s 0.5", 0.5f, 1, 0, 0);
  moved("-o 0.25 0.5 0", 1, 1, 0.25f, 0.5f);
  moved("-o .25 -s 2 2 2", 2, 2, 0.25f, 0);
  // Clamped: the border texels continue beyond the edges.
  const std::vector<Image> clamped = drawn("newmtl m\nmap_Kd -clamp on tex.png\n", box("mtllib a.mtl\n", 9, 9, 3, 3));
  const std::vector<Image> corner =
      drawn("newmtl m\nmap_Kd tex.png\n", box("mtllib a.mtl\n", 0, 0, 23.5f / 24, 15.5f / 16));
  EXPECT_GE(test::psnr(clamped, corner), 50);
  put_file(path("a.mtl"), "newmtl m\nmap_Kd -mm 0.2 0.5 tex.png\n");
  put_file(path(), box("mtllib a.mtl\n"));
  test::expect_error(Status::input, {path(), "a.mtl, line 2", "map_Kd", "-mm 0.2 0.5"}, [&] { load_mesh(path()); });
  drawn("newmtl m\nmap_Kd tex.png\nmap_d holes.png\n");
  EXPECT_NE(warnings_.text().find("map_d"), std::string::npos) << warnings_.text();
}

// Found like the pictures of a list.
TEST_F(Obj, FilesAreFoundWhereverTheirPathsLead) {
  for (const char* name : {"Tex.PNG", "TEX.jpg", "tex.tga", "C:\\Users\\me\\Desktop\\tex.png", "/home/me/model/tex.png",
                           "../maps/tex.png", "textures\\tex.png", ".\\tex.png", "//server/share/tex.png"})
    expect_plain(fmt::format("newmtl m\nKd 1 1 1\nmap_Kd {}\n", name));
  for (const char* name : {"A.MTL", "C:\\models\\a.mtl", "/home/me/a.mtl", "./a.mtl", "x/a.mtl", "..\\a.mtl"})
    expect_plain("newmtl m\nKd 1 1 1\nmap_Kd tex.png\n", box(fmt::format("mtllib {}\n", name)));
  std::filesystem::create_directory(path("Textures"));
  std::filesystem::rename(path("tex.png"), path("Textures/tex.png"));
  const std::vector<Image> below = drawn("newmtl m\nKd 1 1 1\nmap_Kd D:\\x\\tex.png\n");
  std::filesystem::rename(path("Textures/tex.png"), path("tex.png"));
  EXPECT_GE(test::psnr(below, drawn("newmtl m\nmap_Kd tex.png\n")), 50);
  EXPECT_EQ(warnings_.text(), "");
  put_file(path("a.mtl"), "newmtl m\nmap_Kd TEX.jpg\n");
  std::filesystem::copy(path("tex.png"), path("tex.jpeg"));
  test::expect_error(Status::input, {path(), "its texture", "tex.png", "tex.jpeg", "TEX.jpg"},
                     [&] { load_mesh(path()); });
  put_file(path("b c.mtl"), "newmtl other\n");  // several files in one line, a name with a blank
  expect_plain("newmtl m\nKd 1 1 1\nmap_Kd tex.png\n", box("mtllib b c.mtl a.mtl\n"));
  expect_plain("newmtl m\nKd 1 1 1\nmap_Kd tex.png\n", box("mtllib a.MTL  b c.mtl\n"));
  put_file(path("a.mtl"), "newmtl m\nmap_Kd wood/tex1.png\n");
  test::expect_error(Status::input, {path(), "wood/tex1.png is missing", "looked for"}, [&] { load_mesh(path()); });
  put_file(path(), box("mtllib C:\\b.mtl\n"));
  test::expect_error(Status::input, {path(), "b.mtl is missing"}, [&] { load_mesh(path()); });
}

TEST_F(Obj, ColoursOfMaterials) {
  const std::vector<Image> grey = drawn("newmtl m\nKd 0.25 0.25 0.25\n");
  for (const char* text :
       {"newmtl m\nKd 0.25\nKa 0\nillum 1\n", "newmtl m\nKD 0.25 0.25 0.25\n", "newmtl m\nkd 0.25 # grey\n"})
    EXPECT_GE(test::psnr(drawn(text), grey), 50) << text;
  EXPECT_EQ(warnings_.text(), "");
  for (const char* form : {"xyz 0.2 0.3 0.4", "spectral file.rfl 1"}) {
    put_file(path("a.mtl"), fmt::format("newmtl m\nKd {}\n", form));
    test::expect_error(Status::input, {path(), "a.mtl, line 2", "Kd", std::string(form).substr(0, 3)},
                       [&] { load_mesh(path()); });
  }
  drawn("newmtl m\nKd 1 1 1\nmap_Ka tex.png\n");
  EXPECT_NE(warnings_.text().find("map_Ka"), std::string::npos) << warnings_.text();
}

TEST_F(Obj, MaterialsThatAreNowhereAreReported) {
  const std::string mtl = "newmtl other\nKd 1 0 0\nnewmtl my m\nmap_Kd tex.png\n";
  std::string obj = box("mtllib a.mtl\n");
  const auto used = [&](const std::string& name) {
    const std::size_t at = obj.find("usemtl ");
    return std::string(obj).replace(at, obj.find('\n', at) - at, "usemtl " + name);
  };
  expect_plain(mtl, used("my m"));
  expect_plain(mtl, used("my m  "));
  EXPECT_EQ(warnings_.text(), "");
  drawn(mtl, used("My M"));
  EXPECT_NE(warnings_.text().find("\"My M\""), std::string::npos) << warnings_.text();
}

TEST_F(Obj, WhatIsPassedOverInPlyIsReported) {
  const auto head = [](const std::string& comments, const std::string& vertex, const std::string& face) {
    return "ply\r\nformat ascii 1.0\r\n" + comments +
           "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n" + vertex +
           "element face 1\nproperty list uchar int vertex_indices\n" + face + "end_header\n";
  };
  put_file(path("a.ply"), head("", "", "property uchar red\nproperty uchar green\nproperty uchar blue\n") +
                              "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n");
  load_mesh(path("a.ply"));
  EXPECT_NE(warnings_.text().find("colours of its faces"), std::string::npos) << warnings_.text();
  put_file(path("a.ply"),
           head("", "property uchar diffuse_red\nproperty uchar diffuse_green\nproperty uchar diffuse_blue\n", "") +
               "0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n3 0 1 2\n");
  load_mesh(path("a.ply"));
  EXPECT_NE(warnings_.text().find("diffuse_red"), std::string::npos) << warnings_.text();
  put_file(path("a.ply"),
           head("comment TextureFile tex.png\ncomment TextureFile b.png\n", "", "") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  test::expect_error(Status::input, {path("a.ply"), "several textures", "tex.png", "b.png"},
                     [&] { load_mesh(path("a.ply")); });
}

TEST_F(Obj, LightOfItsOwn) {
  const auto dark = drawn("newmtl m\nKd 0 0 0\n"), glowing = drawn("newmtl m\nKd 0 0 0\nKe 0.5 0 0\n");
  for (std::size_t i = 0; i < glowing[0].data.size(); i += 4) {
    const float* p = &glowing[0].data[i];
    if (p[3] > 0) {
      EXPECT_NEAR(p[0], 0.5, 1e-3);
      EXPECT_EQ(dark[0].data[i], 0);
    }
  }
}

TEST_F(Obj, ColoursOfVertices) {
  const test::BoxShape shape;
  const auto coloured = [&](double range, const std::string& format) {
    std::string out;
    for (std::size_t i = 0; i < 24; ++i) {
      const auto colour = [&](std::size_t c) { return static_cast<double>((7 * i + 5 * c) % 11) / 10 * range; };
      out += fmt::format("{}{} {} {} {} {} {}\n", format == "obj" ? "v " : "", shape.positions[3 * i],
                         shape.positions[3 * i + 1], shape.positions[3 * i + 2], colour(0), colour(1), colour(2));
    }
    for (std::size_t i = 0; i < 36; i += 3) {
      const int first = format == "obj" ? 1 : 0;
      out += fmt::format("{} {} {} {}\n", format == "obj" ? "f" : "3", shape.indices[i] + first,
                         shape.indices[i + 1] + first, shape.indices[i + 2] + first);
    }
    return out;
  };
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 24\nproperty float x\nproperty float y\nproperty float z\nproperty float "
      "red\nproperty float green\nproperty float blue\nelement face 12\nproperty list uchar int vertex_indices\n"
      "end_header\n";
  put_file(path("a.ply"), head + coloured(1, "ply"));
  const std::vector<Image> ply = test::drawn(path("a.ply"));
  put_file(path(), coloured(1, "obj"));
  EXPECT_GE(test::psnr(test::drawn(path()), ply), 50) << "as the same in a PLY file: no grey beside it";
  EXPECT_EQ(warnings_.text(), "");
  put_file(path(), coloured(255, "obj"));
  EXPECT_GE(test::psnr(test::drawn(path()), ply), 50) << "of 0 to 255";
  EXPECT_NE(warnings_.text().find("0 to 255"), std::string::npos);
  put_file(path("b.ply"), head + coloured(255, "ply"));
  EXPECT_GE(test::psnr(test::drawn(path("b.ply")), ply), 50) << "of 0 to 255 in a PLY file";
}

// A prism over a concave polygon, its ends as one face each or as known correct triangles.
TEST_F(Obj, ConcaveFaces) {
  const float x[] = {1, 1, 0, 0, -1, -1}, y[] = {-1, 0, 0, 1, 1, -1};  // an L
  const char* triangles[] = {"0 1 2", "0 2 5", "2 3 5", "3 4 5"};
  for (int start = 0; start < 6; ++start) {
    std::string whole, cut, ply;
    for (const float z : {0.4f, -0.4f})
      for (int i = 0; i < 6; ++i) ply += fmt::format("{} {} {}\n", x[(i + start) % 6], y[(i + start) % 6], z);
    for (std::size_t at = 0; at < ply.size(); at = ply.find('\n', at) + 1)
      whole += "v " + ply.substr(at, ply.find('\n', at) + 1 - at);
    cut = whole;
    const auto corner = [&](int i) { return (i - start + 6) % 6; };
    whole += "f 1 2 3 4 5 6\nf 12 11 10 9 8 7\n";
    ply += "6 0 1 2 3 4 5\n6 11 10 9 8 7 6\n";
    for (const char* t : triangles) {
      const int a = corner(t[0] - '0'), b = corner(t[2] - '0'), c = corner(t[4] - '0');
      cut += fmt::format("f {} {} {}\nf {} {} {}\n", a + 1, b + 1, c + 1, c + 7, b + 7, a + 7);
    }
    for (int i = 0; i < 6; ++i) {
      const int j = (i + 1) % 6;
      for (std::string* out : {&whole, &cut}) *out += fmt::format("f {} {} {} {}\n", i + 1, i + 7, j + 7, j + 1);
      ply += fmt::format("4 {} {} {} {}\n", i, i + 6, j + 6, j);
    }
    put_file(path("cut.obj"), cut);
    put_file(path(), whole);
    put_file(path("a.ply"),
             "ply\nformat ascii 1.0\nelement vertex 12\nproperty float x\nproperty float y\nproperty float z\nelement "
             "face 8\nproperty list uchar int vertex_indices\nend_header\n" +
                 ply);
    const std::vector<Image> want = test::drawn(path("cut.obj"));
    const auto area = [](const std::vector<Image>& of) {
      double out = 0;
      for (const Image& image : of)
        for (std::size_t i = 3; i < image.data.size(); i += 4) out += image.data[i];
      return out;
    };
    EXPECT_EQ(area(test::drawn(path())), area(want)) << start;
    EXPECT_GE(test::psnr(test::drawn(path()), want), 50) << start;
    EXPECT_EQ(area(test::drawn(path("a.ply"))), area(want)) << start;
  }
}

using Corners = std::vector<std::array<float, 3>>;

// Compares the polygon's area from its corners with the sum over its triangles: a difference means that triangles
// overlap.
void expect_covered(const Corners& corners, const std::string& what) {
  const auto cross = [&](std::size_t a, std::size_t b, std::size_t c) {
    std::array<double, 3> u{}, v{};
    for (int d = 0; d < 3; ++d) u[d] = corners[b][d] - corners[a][d], v[d] = corners[c][d] - corners[a][d];
    return std::array<double, 3>{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  };
  std::array<double, 3> whole{};
  for (std::size_t i = 2; i < corners.size(); ++i)
    for (int d = 0; d < 3; ++d) whole[d] += cross(0, i - 1, i)[d];
  const double area = std::hypot(whole[0], whole[1], whole[2]);
  double sum = 0;
  const auto triangles = read::triangulate(corners);
  EXPECT_EQ(triangles.size(), corners.size() - 2) << what;
  for (const auto& t : triangles) {
    const auto one = cross(t[0], t[1], t[2]);
    sum += std::hypot(one[0], one[1], one[2]);
    EXPECT_GE(one[0] * whole[0] + one[1] * whole[1] + one[2] * whole[2], -1e-4 * area * area)
        << what << ": wound as it is";
  }
  EXPECT_NEAR(sum, area, 1e-4 * area) << what;
}

TEST(Triangulate, CoversPolygonsAndNothingElse) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int n = 3; n < 60; ++n)
    for (int plane = 0; plane < 4; ++plane) {
      Corners star;  // any simple polygon that is star-shaped about its centre
      for (int i = 0; i < n; ++i) {
        const float angle = 6.2831853f * (static_cast<float>(i) + 0.8f * unit(random)) / static_cast<float>(n);
        const float r = 0.1f + unit(random), x = r * std::cos(angle), y = r * std::sin(angle);
        if (plane == 0) star.push_back({x, y, 7});
        if (plane == 1) star.push_back({-3, y, x});
        if (plane == 2) star.push_back({x, 2, y});
        if (plane == 3) star.push_back({x, y, x + 0.5f * y});
      }
      expect_covered(star, fmt::format("{} corners, plane {}", n, plane));
    }
  Corners spiral;
  for (int i = 0; i < 200; ++i)
    spiral.push_back({(1.0f + 0.01f * static_cast<float>(i)) * std::cos(0.1f * static_cast<float>(i)),
                      (1.0f + 0.01f * static_cast<float>(i)) * std::sin(0.1f * static_cast<float>(i)), 0});
  for (int i = 199; i >= 0; --i)
    spiral.push_back({(1.2f + 0.01f * static_cast<float>(i)) * std::cos(0.1f * static_cast<float>(i)),
                      (1.2f + 0.01f * static_cast<float>(i)) * std::sin(0.1f * static_cast<float>(i)), 0});
  expect_covered(spiral, "a spiral");
  Corners comb;  // with collinear corners
  for (int i = 0; i < 40; ++i) comb.push_back({static_cast<float>(i), i % 2 == 0 ? 0.0f : 5.0f, 0});
  for (int i = 39; i >= 0; --i) comb.push_back({static_cast<float>(i), -1, 0});
  expect_covered(comb, "a comb");
  EXPECT_EQ(read::triangulate(Corners(5, {1, 1, 1})).size(), 3u) << "all in one point";
  Corners zigzag;
  for (int i = 0; i < 20'001; ++i) zigzag.push_back({static_cast<float>(i), i % 2 == 0 ? 0.0f : 1.0f, 0});
  EXPECT_THROW(read::triangulate(zigzag), std::length_error);
}

}  // namespace
}  // namespace vsplat

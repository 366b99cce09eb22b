#include "model/io/scene/ply.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <random>

#include "tests/model/io/scene/ply_fixture.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

using test::floats;

class Ply : public test::PlyFixture {};

std::string header(int count, const std::vector<std::string>& properties, const std::string& more = "") {
  std::string out = "ply\nformat binary_little_endian 1.0\n" + more + "element vertex " + std::to_string(count) + "\n";
  for (const std::string& p : properties) out += "property " + p + "\n";
  return out + "end_header\n";
}

const std::vector<std::string> kPlain{
    "float x",       "float y",       "float z",       "float f_dc_0", "float f_dc_1", "float f_dc_2", "float opacity",
    "float scale_0", "float scale_1", "float scale_2", "float rot_0",  "float rot_1",  "float rot_2",  "float rot_3"};
const std::vector<float> kRow{1, 2, 3, 0.1f, 0.2f, 0.3f, 0, -1, -2, -3, 1, 0, 0, 0};

TEST_F(Ply, RoundTripsEveryDegree) {
  for (int degree = 0; degree <= 3; ++degree) {
    Scene scene;
    scene.gaussians = test::make_scene({"", 50, degree, 0, 0, "opacity"}, 1);
    scene.near = 0.0731f;
    if (degree == 2) scene.mirror = {0.1f, -2.5f, 1e-7f};
    if (degree > 1) scene.detail = Detail{{0.1f, 2.5e3f, -1e-7f}, 0.0123f};
    if (degree > 0) scene.up = {0.6f, 0, -0.8f};
    write_ply(path(), scene);
    const Scene again = read_ply(path());
    const Gaussians &a = scene.gaussians, &b = again.gaussians;
    ASSERT_EQ(a.count, b.count);
    EXPECT_EQ(a.sh_degree, b.sh_degree);
    EXPECT_EQ(again.near, scene.near);
    EXPECT_EQ(again.mirror, scene.mirror);
    EXPECT_EQ(again.up, scene.up);
    ASSERT_EQ(again.detail.has_value(), scene.detail.has_value());
    if (scene.detail) {
      EXPECT_EQ(again.detail->at, scene.detail->at);
      EXPECT_EQ(again.detail->pixel, scene.detail->pixel);
    }
    EXPECT_EQ(a.means, b.means);
    EXPECT_EQ(a.sh, b.sh);
    for (std::size_t i = 0; i < a.scales.size(); ++i) EXPECT_NEAR(b.scales[i], a.scales[i], 1e-6 * a.scales[i]);
    for (std::size_t i = 0; i < a.quats.size(); ++i) EXPECT_NEAR(b.quats[i], a.quats[i], 1e-6);
    for (std::size_t i = 0; i < a.opacities.size(); ++i) {
      EXPECT_NEAR(b.opacities[i], a.opacities[i], 1e-6 * a.opacities[i]);
      if (a.opacities[i] == 0 || a.opacities[i] == 1) {
        EXPECT_EQ(b.opacities[i], a.opacities[i]);
      }
    }
    EXPECT_EQ(warnings_.text(), "");
  }
}

// The de facto standard's layout, to the byte.
TEST_F(Ply, WritesTheStandardLayout) {
  Scene scene;
  Gaussians& g = scene.gaussians;
  g.count = 1;
  g.sh_degree = 1;
  g.means = {1, 2, 3};
  g.scales = {1, 0.5f, 4};
  g.quats = {0.5f, 0.5f, -0.5f, 0.5f};
  g.opacities = {0.5f};
  for (int i = 0; i < 12; ++i) g.sh.push_back(static_cast<float>(i));
  write_ply(path(), scene);
  std::string want =
      "ply\nformat binary_little_endian 1.0\ncomment vsplat near 0.2\ncomment SH degree: 1\nelement vertex 1\nproperty "
      "float x\nproperty float y\n"
      "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float f_dc_0\nproperty "
      "float f_dc_1\nproperty float f_dc_2\n";
  for (int i = 0; i < 9; ++i) want += "property float f_rest_" + std::to_string(i) + "\n";
  want +=
      "property float opacity\nproperty float scale_0\nproperty float scale_1\nproperty float scale_2\nproperty float "
      "rot_0\nproperty float rot_1\n"
      "property float rot_2\nproperty float rot_3\nend_header\n";
  want +=
      floats({1,    2,    3,     0,   0, 0, 0, 1, 2, 3, 6, 9, 4, 7, 10, 5, 8, 11, 0, 0, std::log(0.5f), std::log(4.0f),
              0.5f, 0.5f, -0.5f, 0.5f});
  EXPECT_EQ(bytes(), want);
}

TEST_F(Ply, UpIsOfLengthOne) {
  put(header(1, kPlain, "comment vsplat up 0 -3 4\n") + floats(kRow));
  EXPECT_EQ(read_ply(path()).up, (std::array<float, 3>{0, -0.6f, 0.8f}));
}

TEST_F(Ply, AntialiasingIsTheRenderModeMip) {
  Scene scene;
  scene.gaussians = test::make_scene({"", 2, 0, 0, 0, ""}, 1);
  for (const bool antialias : {false, true}) {
    scene.antialias = antialias;
    write_ply(path(), scene);
    EXPECT_EQ(bytes().find("comment SplatRenderMode: mip\n") != std::string::npos, antialias);
    EXPECT_EQ(read_ply(path()).antialias, antialias);
  }
  for (const char* mode : {"default", "2dgs"}) {
    put(header(1, kPlain, fmt::format("comment SplatRenderMode: {}\n", mode)) + floats(kRow));
    EXPECT_FALSE(read_ply(path()).antialias) << mode;
  }
  for (const int flag : {0, 1}) {  // as Postshot writes it
    put(header(1, kPlain, fmt::format("comment antialiased {}\n", flag)) + floats(kRow));
    EXPECT_EQ(read_ply(path()).antialias, flag == 1);
  }
  EXPECT_EQ(warnings_.text(), "");
  put(header(1, kPlain, "comment SplatRenderMode: blurred\n") + floats(kRow));
  EXPECT_FALSE(read_ply(path()).antialias);
  EXPECT_NE(warnings_.text().find("SplatRenderMode: blurred"), std::string::npos);
}

TEST_F(Ply, OffsetsAreKeptToTheBit) {
  Scene scene;
  scene.gaussians = test::make_scene({"", 3, 0, 0, 0, ""}, 1);
  scene.offset = {1e7 + 1.0 / 3, -0.1, 12345678.000000123};
  write_ply(path("scene.ply"), scene);
  const Scene again = read_ply(path("scene.ply"));
  EXPECT_EQ(again.offset, scene.offset);
  EXPECT_EQ(again.gaussians.means, scene.gaussians.means);
  put(header(1, kPlain, "comment vsplat offset 10000000 0 -2.5\n") + floats(kRow));
  EXPECT_EQ(read_ply(path("scene.ply")).offset, Eigen::Vector3d(1e7, 0, -2.5));
}

TEST_F(Ply, EmptyScenesAreLegal) {
  write_ply(path(), Scene());
  EXPECT_EQ(read_ply(path()).gaussians.count, 0u);
  EXPECT_EQ(warnings_.text(), "");
}

TEST_F(Ply, ReadsAnyOrderAndSkipsTheRest) {
  std::vector<std::string> names = kPlain;
  std::vector<float> row = kRow;
  std::mt19937 engine(4);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<std::size_t> order(kPlain.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), engine);
    for (std::size_t i = 0; i < order.size(); ++i) {
      names[i] = kPlain[order[i]];
      row[i] = kRow[order[i]];
    }
    names.insert(names.begin() + 5, "uchar something");
    const std::string data = floats({row.begin(), row.begin() + 5}) + "\x7f" + floats({row.begin() + 5, row.end()});
    put(header(2, names, "comment generated by nobody\nobj_info x\n") + data + data);
    names.erase(names.begin() + 5);
    const Gaussians g = read_ply(path()).gaussians;
    ASSERT_EQ(g.count, 2u);
    EXPECT_EQ(g.means, (std::vector<float>{1, 2, 3, 1, 2, 3}));
    EXPECT_EQ(g.sh, (std::vector<float>{0.1f, 0.2f, 0.3f, 0.1f, 0.2f, 0.3f}));
    EXPECT_EQ(g.opacities[1], 0.5f);
    EXPECT_FLOAT_EQ(g.scales[5], std::exp(-3.0f));
    EXPECT_EQ(g.quats[4], 1.0f);
  }
}

TEST_F(Ply, ReadsOtherTypesAndDefaults) {
  std::string row(24, '\0');
  const double position[3] = {0.25, -7, 1e3};
  std::memcpy(row.data(), position, 24);
  row += std::string("\xff\x00\x80", 3);
  put(header(1, {"double x", "float64 y", "double z", "uchar red", "uint8 green", "uchar blue"}) + row);
  const Gaussians g = read_ply(path()).gaussians;
  EXPECT_EQ(g.means, (std::vector<float>{0.25f, -7, 1000}));
  EXPECT_NEAR(0.28209479177387814 * g.sh[0] + 0.5, 1, 1e-6);
  EXPECT_NEAR(0.28209479177387814 * g.sh[1] + 0.5, 0, 1e-6);
  EXPECT_NEAR(0.28209479177387814 * g.sh[2] + 0.5, 128 / 255.0, 1e-6);
  EXPECT_EQ(g.opacities, (std::vector<float>{0.5f}));
  EXPECT_EQ(g.scales, std::vector<float>(3, std::exp(-4.0f)));
  EXPECT_EQ(g.quats, (std::vector<float>{1, 0, 0, 0}));
}

TEST_F(Ply, SkipsElementsBeforeAndAfter) {
  const std::string more = "element camera 3\nproperty short a\nproperty double b\n";
  std::string head = header(1, kPlain, more);
  head.insert(head.find("end_header"), "element face 2\nproperty list uchar int vertex_indices\n");
  put(head + std::string(30, 'c') + floats(kRow) + "\x01" + std::string(4, 'f') + std::string(1, '\0'));
  EXPECT_EQ(read_ply(path()).gaussians.means, (std::vector<float>{1, 2, 3}));
  EXPECT_EQ(warnings_.text(), "");
}

TEST_F(Ply, InfiniteOpacityIsAllOrNothing) {
  std::vector<float> a = kRow, b = kRow;
  a[6] = std::numeric_limits<float>::infinity();
  b[6] = -a[6];
  put(header(2, kPlain) + floats(a) + floats(b));
  EXPECT_EQ(read_ply(path()).gaussians.opacities, (std::vector<float>{1, 0}));
}

TEST_F(Ply, NamesTheFieldThatIsNoNumber) {
  const std::string head = header(3, kPlain);
  for (std::size_t i = 0; i < kRow.size(); ++i) {
    for (const float v : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()}) {
      if (i == 6 && std::isinf(v)) continue;
      if (i >= 7 && i < 10 && v < 0) continue;  // flat
      std::vector<float> row = kRow;
      row[i] = v;
      const std::string text = complaint(head + floats(kRow) + floats(row) + floats(kRow));
      const std::size_t offset = head.size() + 4 * (kRow.size() + i);
      EXPECT_NE(text.find("Gaussian 1, " + kPlain[i].substr(6) + " (byte " + std::to_string(offset) + ")"),
                std::string::npos)
          << text;
    }
  }
}

TEST_F(Ply, RefusesZeroQuaternionsAndHugeScales) {
  std::vector<float> row = kRow;
  row[10] = 0;
  EXPECT_NE(complaint(header(1, kPlain) + floats(row)).find("Gaussian 0, rot_0"), std::string::npos);
  row = kRow;
  row[8] = 100;
  EXPECT_NE(complaint(header(1, kPlain) + floats(row)).find("Gaussian 0, scale_1"), std::string::npos);
}

TEST_F(Ply, RefusesByName) {
  const std::string good = header(1, kPlain) + floats(kRow);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return complaint(text);
  };
  EXPECT_NE(with("binary_little_endian", "binary\x01").find("\"binary?\" is unknown"), std::string::npos);
  EXPECT_NE(with("vertex 1", "vertex 99999999999999999999999").find("no count"), std::string::npos);
  EXPECT_NE(with("vertex 1", "vertex 18446744073709551615").find("promises 18446744073709551615"), std::string::npos);
  EXPECT_NE(with("vertex 1", "vertex 329406144173384851").find("promises"),
            std::string::npos);  // times 56 is 2^64 + 40
  EXPECT_NE(with("vertex 1", "vertex -1").find("element vertex: \"-1\" is no count"), std::string::npos);
  EXPECT_NE(with("vertex 1", "vertex 99999999999999").find("promises 99999999999999 of 56 bytes"), std::string::npos);
  EXPECT_NE(with("vertex 1", fmt::format("vertex {}", (std::uint64_t{1} << 63) / 56 + 1)).find("promises"),
            std::string::npos);
  const std::string end = std::to_string(good.size()), begin = std::to_string(good.size() - 56);
  EXPECT_NE(with("vertex 1", "vertex 2")
                .find("promises 2 of 56 bytes each from byte " + begin + " on, the file has " + end +
                      " bytes, which is 1 of them"),
            std::string::npos);
  EXPECT_NE(with("element vertex", "element points").find("no element vertex"), std::string::npos);
  EXPECT_NE(with("float y", "float yy").find("no property y"), std::string::npos);
  EXPECT_NE(with("float rot_2", "float rot_7").find("no property rot_2"), std::string::npos);
  EXPECT_NE(with("float scale_1", "float depth").find("no property scale_1"), std::string::npos);
  EXPECT_NE(with("float opacity", "half opacity").find("unknown type \"half\""), std::string::npos);
  EXPECT_NE(with("float opacity", "float x").find("twice"), std::string::npos);
  EXPECT_NE(with("float opacity", "list uchar int opacity").find("list opacity"), std::string::npos);
  EXPECT_NE(with("float opacity", "float f_rest_0").find("f_rest"), std::string::npos);
  EXPECT_NE(with("float f_dc_0", "float f_dc_9").find("f_dc_0"), std::string::npos);
  EXPECT_NE(with("float x", "uint packed_position").find("no property packed_rotation"), std::string::npos);
  EXPECT_NE(with("ply", "PLY").find("line 1"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat near nothing\nelement").find("vsplat near"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat near -1\nelement").find("at least 0"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat mirror_camera_about 1 2\nelement").find("3 finite"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat offset 1 2\nelement").find("3 finite"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat offset 1 inf 2\nelement").find("3 finite"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat offset 1 -1e16 2\nelement").find("at most"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat up 0 1\nelement").find("3 finite"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat up 0 nan 1\nelement").find("3 finite"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat up 0 -0 0\nelement").find("a direction"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat detail 0.1 1 2\nelement").find("4 finite"), std::string::npos);
  EXPECT_NE(with("element", "comment vsplat detail 0 1 2 3\nelement").find("above 0"), std::string::npos);
  EXPECT_NE(with("end_header", "something").find("something"), std::string::npos);
  EXPECT_NE(complaint("ply\n" + std::string(2 << 20, 'x')).find("line 2 (byte 4): there is no end_header within"),
            std::string::npos);
  std::string many = header(0, kPlain);
  for (int i = 0; i < 2000; ++i) many.insert(many.find("end_header"), fmt::format("property float p{}\n", i));
  EXPECT_NE(complaint(many).find("more than 1024 properties"), std::string::npos);
  EXPECT_THROW(read_ply(path("absent.ply")), Error);
  EXPECT_THROW(read_ply("/dev/zero"), Error);
  EXPECT_THROW(read_ply(folder_.string()), Error);
}

TEST_F(Ply, WarnsOfBytesBeyond) {
  put(header(1, kPlain) + floats(kRow) + "abc");
  EXPECT_EQ(read_ply(path()).gaussians.count, 1u);
  EXPECT_NE(warnings_.text().find("3 bytes"), std::string::npos) << warnings_.text();
}

// An impossible count is refused before memory is allocated for it.
TEST_F(Ply, PromisesTakeNoMemory) {
  for (const char* format : {"binary_little_endian", "binary_big_endian", "ascii"}) {
    std::string head = header(0, kPlain);
    head.replace(head.find("binary_little_endian"), 20, format);
    head.replace(head.find("vertex 0"), 8, "vertex 1000000000000");
    EXPECT_NE(complaint(head + floats(kRow)).find("promises 1000000000000"), std::string::npos);
  }
}

TEST_F(Ply, SkipsBadOnesAndCountsThem) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const auto with = [](std::size_t i, float v) {
    std::vector<float> row = kRow;
    row[i] = v;
    return floats(row);
  };
  const std::string head = header(8, kPlain);
  put(head + with(0, 7) + with(2, nan) + with(4, inf) + with(6, nan) + with(6, inf) + with(8, 89) + with(10, 0) +
      with(0, 9));
  SkippedGaussians skipped;
  skipped.huge_scale = 5;  // left from an earlier file
  const Gaussians g = read_ply(path(), &skipped).gaussians;
  EXPECT_EQ(g.count, 3u);
  EXPECT_EQ(g.means, (std::vector<float>{7, 2, 3, 1, 2, 3, 9, 2, 3}));
  EXPECT_EQ(g.opacities, (std::vector<float>{0.5f, 1, 0.5f}));
  EXPECT_EQ(g.scales.size(), 9u);
  EXPECT_EQ(g.quats.size(), 12u);
  EXPECT_EQ(g.sh.size(), 9u);
  EXPECT_EQ(skipped.not_finite, 3u);
  EXPECT_EQ(skipped.huge_scale, 1u);
  EXPECT_EQ(skipped.zero_rotation, 1u);
  EXPECT_NE(warnings_.text().find("5 of 8 Gaussians are left out: 3 "), std::string::npos) << warnings_.text();
  EXPECT_NE(warnings_.text().find("Gaussian 1, z (byte " + std::to_string(head.size() + 64) + ")"), std::string::npos);

  warnings_.all.clear();
  put(header(1, kPlain) + floats(kRow));
  EXPECT_EQ(read_ply(path(), &skipped).gaussians.count, 1u);
  EXPECT_EQ(skipped.total(), 0u);
  EXPECT_EQ(warnings_.text(), "");
}

// Damage to the whole file is an error even if Gaussians may be skipped.
TEST_F(Ply, SkippingPassesOverNoOtherDamage) {
  SkippedGaussians skipped;
  put(header(2, kPlain) + floats(kRow));
  EXPECT_THROW(read_ply(path(), &skipped), Error);
}

TEST_F(Ply, ReadsBigEndian) {
  std::string data = floats(kRow) + floats(kRow);
  for (std::size_t i = 0; i < data.size(); i += 4) std::reverse(data.begin() + i, data.begin() + i + 4);
  std::string head = header(2, kPlain, "element camera 1\nproperty short a\n");
  head.replace(head.find("little"), 6, "big");
  put(head + "ab" + data);
  const Gaussians g = read_ply(path()).gaussians;
  EXPECT_EQ(g.means, (std::vector<float>{1, 2, 3, 1, 2, 3}));
  EXPECT_EQ(g.sh, (std::vector<float>{0.1f, 0.2f, 0.3f, 0.1f, 0.2f, 0.3f}));
  EXPECT_FLOAT_EQ(g.scales[5], std::exp(-3.0f));
  EXPECT_EQ(warnings_.text(), "");
}

// The same scene as text: nine digits represent every float exactly.
TEST_F(Ply, ReadsText) {
  std::string head = header(2, kPlain, "element camera 2\nproperty list uchar int a\n");
  head.replace(head.find("binary_little_endian"), 20, "ascii");
  const std::string row = "1 +2 3.0\t0.1 2e-1 .3  0 -1 -2 -3 1 0 0 0";
  put(head + "2 1 2\n0\n" + row + "\n\n  " + row + " \r\n\n");
  const Gaussians g = read_ply(path()).gaussians;
  EXPECT_EQ(g.means, (std::vector<float>{1, 2, 3, 1, 2, 3}));
  EXPECT_EQ(g.sh, (std::vector<float>{0.1f, 0.2f, 0.3f, 0.1f, 0.2f, 0.3f}));
  EXPECT_FLOAT_EQ(g.scales[5], std::exp(-3.0f));
  EXPECT_EQ(warnings_.text(), "");
  put(head + "0\n0\n" + row + "\n" + row);  // the last line has no line end
  EXPECT_EQ(read_ply(path()).gaussians.count, 2u);
  put(head + "0\n0\n" + row + "\n" + row + "\n\nmore");
  EXPECT_EQ(read_ply(path()).gaussians.count, 2u);
  EXPECT_NE(warnings_.text().find("5 bytes after the last element"), std::string::npos) << warnings_.text();
}

TEST_F(Ply, RefusesDamagedTextByName) {
  std::string head = header(2, kPlain);
  head.replace(head.find("binary_little_endian"), 20, "ascii");
  const std::string row = "1 2 3 0.1 0.2 0.3 0 -1 -2 -3 1 0 0 0\n";
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string bad = row;
    bad.replace(bad.find(from), from.size(), to);
    return complaint(head + row + bad);
  };
  const auto at = [&](std::size_t i) { return " (byte " + std::to_string(head.size() + row.size() + i) + "): "; };
  EXPECT_NE(with("2 3", "2 x").find("Gaussian 1, z" + at(4) + "\"x\", a number is expected"), std::string::npos);
  EXPECT_NE(with("0.1", "0.1.1").find("Gaussian 1, f_dc_0" + at(6)), std::string::npos);
  EXPECT_NE(with("0.1", "nan").find("Gaussian 1, f_dc_0" + at(6) + "NaN, a finite"), std::string::npos);
  EXPECT_NE(with("0.1", "1e39").find("Gaussian 1, f_dc_0" + at(6) + "1e+39, a finite"), std::string::npos);
  EXPECT_NE(with("0.1", "-1e999").find("-infinity, a finite"), std::string::npos);
  EXPECT_EQ(with("0.1", "-1e-999"), "");
  EXPECT_NE(with("0 0 0\n", "0 0\n").find("Gaussian 1, rot_3" + at(34) + "\"\""), std::string::npos);
  EXPECT_NE(with("\n", " 0\n").find("Gaussian 1" + at(37) + "more than the 14 values"), std::string::npos);
  EXPECT_NE(complaint(head + row).find("promises 2"), std::string::npos);
  std::string dense = "1 2 3 4 5 6 0 1 2 3 1 0 0 0\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n\n";
  EXPECT_NE(complaint(head + dense).find("promises 2 rows, the file ends after 1"), std::string::npos);
  EXPECT_NE(complaint(head + std::string(3 << 20, '1')).find("row 0 (byte"), std::string::npos);
}

// A very large float colour, divided by 0.28, overflows.
TEST_F(Ply, RefusesColoursThatOverflow) {
  const std::vector<std::string> names{"float x", "float y", "float z", "float red", "float green", "float blue"};
  EXPECT_NE(complaint(header(1, names) + floats({1, 2, 3, 0, 3e38f, 0})).find("Gaussian 0, green (byte"),
            std::string::npos);
}

TEST_F(Ply, SurvivesDamage) { expect_survives_damage(test::make_scene({"", 20, 1, 0, 0, ""}, 3)); }

TEST_F(Ply, WritesNothingThatIsNoNumber) {
  Scene scene;
  scene.gaussians = test::make_scene({"", 5, 1, 0, 0, ""}, 3);
  scene.gaussians.scales[4] = -1;
  EXPECT_THROW(write_ply(path(), scene), Error);
  scene.gaussians.scales[4] = 1;
  scene.gaussians.opacities[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(write_ply(path(), scene), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder_.string()));
}

TEST_F(Ply, RefusesAFolderThatIsNotThere) { EXPECT_THROW(write_ply(path("no/scene.ply"), Scene()), Error); }

}  // namespace
}  // namespace vsplat

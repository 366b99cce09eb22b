// Non-standard 3DGS PLY files of other programs: read as intended, or reported.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "model/io/scene/ply.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using Rows = std::vector<std::vector<double>>;

const std::vector<std::string> gaussian_names{"x",       "y",       "z",       "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
                                              "scale_0", "scale_1", "scale_2", "rot_0",  "rot_1",  "rot_2",  "rot_3"};

class PlyKinds : public ::testing::Test {
 protected:
  std::string path() const { return folder_ / "scene.ply"; }
  Gaussians read(const std::string& bytes, SkippedGaussians* skipped = nullptr) const {
    test::put_file(path(), bytes);
    return read_ply(path(), skipped).gaussians;
  }

  test::TemporaryFolder folder_;
  test::Warnings warnings_;
};

std::string head_of(const std::string& format, const std::string& before, const std::vector<std::string>& names,
                    std::size_t count, const std::string& type = "float") {
  std::string out = "ply\nformat " + format + " 1.0\n" + before + fmt::format("element vertex {}\n", count);
  for (const std::string& name : names) out += fmt::format("property {} {}\n", type, name);
  return out + "end_header\n";
}

std::string ascii(const std::vector<std::string>& names, const Rows& rows) {
  std::string out = head_of("ascii", "", names, rows.size());
  for (const auto& row : rows) out += fmt::format("{}\n", fmt::join(row, " "));
  return out;
}

// Gaussians of a standard file, in a cube of edge 1.
Rows gaussians(int count) {
  Rows out;
  for (int i = 0; i < count; ++i) {
    const double a = 0.37 * i;
    out.push_back({0.5 * std::sin(a), 0.5 * std::cos(2 * a), 0.5 * std::sin(3 * a), 0.3, -0.2, 1.1, 2 * std::cos(a),
                   -3 - std::sin(a), -4, -3.5, 1, 0.1, 0, 0.2});
  }
  return out;
}

TEST_F(PlyKinds, FlatGaussiansHaveScaleZero) {
  Rows rows = gaussians(3);
  rows[0][9] = rows[1][7] = rows[1][8] = -std::numeric_limits<double>::infinity();
  const Gaussians g = read(ascii(gaussian_names, rows));
  ASSERT_EQ(g.count, 3u);
  EXPECT_LT(g.scales[2], 1e-30f);
  EXPECT_GT(g.scales[2], 0) << "its logarithm is finite";
  EXPECT_NEAR(g.scales[1], std::exp(-4.0), 1e-6);
  EXPECT_LT(g.scales[3], 1e-30f);
  SkippedGaussians skipped;
  EXPECT_EQ(read(ascii(gaussian_names, rows), &skipped).count, 3u);
  EXPECT_EQ(skipped.total(), 0u);
  Scene scene;
  scene.gaussians = g;
  write_ply(path(), scene);
  EXPECT_EQ(read_ply(path()).gaussians.count, 3u) << "and they can be written";
}

TEST_F(PlyKinds, OneScaleIsRound) {
  std::vector<std::string> names = gaussian_names;
  names.erase(names.begin() + 8, names.begin() + 10);
  Rows rows = gaussians(2);
  for (auto& row : rows) row.erase(row.begin() + 8, row.begin() + 10);
  const Gaussians g = read(ascii(names, rows));
  EXPECT_EQ(g.kind, GaussianKind::volume);
  ASSERT_EQ(g.scales.size(), 6u);
  for (const std::size_t i : {0u, 1u, 2u}) EXPECT_NEAR(g.scales[i], std::exp(-3.0), 1e-6);
}

TEST_F(PlyKinds, ColoursOfAnyRange) {
  std::vector<std::string> names = gaussian_names;
  names[3] = "red", names[4] = "green", names[5] = "blue";
  Rows unit = gaussians(4);
  for (std::size_t i = 0; i < unit.size(); ++i)
    unit[i][3] = 0.25 * static_cast<double>(i), unit[i][4] = 1, unit[i][5] = 0;
  const Gaussians want = read(ascii(names, unit));
  EXPECT_EQ(warnings_.text(), "");
  for (const double range : {255.0, 65535.0}) {
    Rows rows = unit;
    for (auto& row : rows)
      for (std::size_t c = 3; c < 6; ++c) row[c] *= range;
    const Gaussians g = read(ascii(names, rows));
    for (std::size_t i = 0; i < g.sh.size(); ++i) EXPECT_NEAR(g.sh[i], want.sh[i], 1e-5) << range;
    ASSERT_EQ(warnings_.all.size(), 1u) << "it is said";
    EXPECT_NE(warnings_.text().find(fmt::format("as 0 to {}", range)), std::string::npos) << warnings_.text();
    warnings_.all.clear();
  }
}

TEST_F(PlyKinds, NumbersAsWindowsWritesThem) {
  std::string text = ascii(gaussian_names, gaussians(4));
  const auto replace_line = [&](int row, std::size_t column, const std::string& word) {
    std::size_t at = text.find("end_header\n") + 11;
    for (int i = 0; i < row; ++i) at = text.find('\n', at) + 1;
    for (std::size_t i = 0; i < column; ++i) at = text.find(' ', at) + 1;
    text.replace(at, text.find_first_of(" \n", at) - at, word);
  };
  replace_line(1, 6, "1.#INF00");
  EXPECT_EQ(read(text).opacities[1], 1) << "an infinite logit";
  replace_line(2, 0, "-1.#IND00");
  replace_line(3, 8, "1.#QNAN");
  test::expect_error(Status::format, {path(), "Gaussian 2, x", "a finite number is expected"}, [&] { read(text); });
  SkippedGaussians skipped;
  EXPECT_EQ(read(text, &skipped).count, 2u);
  EXPECT_EQ(skipped.not_finite, 2u);
  replace_line(0, 1, "1.#WORD");
  test::expect_error(Status::format, {"1.#WORD"}, [&] { read(text, &skipped); });
}

TEST_F(PlyKinds, ListsBeforeTheGaussians) {
  const std::string faces =
      "element face {}\nproperty uchar kind\nproperty list uchar int vertex_indices\nproperty list "
      "ushort double weights\n";
  const std::vector<double> row = gaussians(1)[0];
  for (const bool big : {false, true}) {
    std::string lists;
    const auto number = [&](auto value, std::string& to) {
      char bytes[sizeof value];
      std::memcpy(bytes, &value, sizeof value);
      if (big) std::reverse(bytes, bytes + sizeof value);
      to.append(bytes, sizeof value);
    };
    for (int face = 0; face < 300; ++face) {
      number(std::uint8_t{7}, lists);
      number(static_cast<std::uint8_t>(3 + face % 4), lists);
      for (int i = 0; i < 3 + face % 4; ++i) number(std::int32_t{i}, lists);
      number(static_cast<std::uint16_t>(face), lists);
      for (int i = 0; i < face; ++i) number(0.5, lists);
    }
    std::string body;
    for (const double v : row) number(static_cast<float>(v), body);
    const std::string format = big ? "binary_big_endian" : "binary_little_endian";
    const auto head = [&](int count) {
      return head_of(format, fmt::format(fmt::runtime(faces), count), gaussian_names, 1);
    };
    EXPECT_NEAR(read(head(0) + body).means[1], 0.5, 1e-6) << "an empty element";
    EXPECT_NEAR(read(head(300) + lists + body).means[1], 0.5, 1e-6);
    test::expect_error(Status::format, {path(), "face", "cut off"}, [&] { read(head(300) + lists.substr(0, 5000)); });
    // One more face count makes the list consume the Gaussian.
    test::expect_error(Status::format, {path(), "cut off"}, [&] { read(head(301) + lists + body); });
  }
  std::string text = ascii(gaussian_names, {row});
  text.insert(text.find("element"), fmt::format(fmt::runtime(faces), 2));
  text.insert(text.find("end_header\n") + 11, "7 3 0 1 2 0\n7 4 0 1 2 3 1 0.5\n");
  EXPECT_NEAR(read(text).means[1], 0.5, 1e-6) << "as text";
}

TEST_F(PlyKinds, ActivatedValuesAreToldOf) {
  const Rows rows = gaussians(20);
  read(ascii(gaussian_names, rows));
  EXPECT_EQ(warnings_.text(), "") << "a standard file";
  Rows opacity = rows, scales = rows;
  for (auto& row : opacity) row[6] = 1 / (1 + std::exp(-row[6]));
  for (auto& row : scales)
    for (std::size_t c = 7; c < 10; ++c) row[c] = std::exp(row[c]);
  read(ascii(gaussian_names, opacity));
  ASSERT_EQ(warnings_.all.size(), 1u);
  EXPECT_NE(warnings_.text().find("logit"), std::string::npos);
  warnings_.all.clear();
  read(ascii(gaussian_names, scales));
  ASSERT_EQ(warnings_.all.size(), 1u);
  EXPECT_NE(warnings_.text().find("logarithm"), std::string::npos);
  warnings_.all.clear();
  Rows wide = scales;  // in millimetres, a Gaussian is larger than 1
  for (auto& row : wide)
    for (std::size_t c = 0; c < 3; ++c) row[c] *= 1000;
  read(ascii(gaussian_names, wide));
  EXPECT_EQ(warnings_.text(), "");
}

TEST_F(PlyKinds, PropertiesOfOtherNamesAreReported) {
  const auto warning = [&](std::vector<std::string> names) {
    warnings_.all.clear();
    Rows rows = gaussians(3);
    for (auto& row : rows) row.resize(names.size());
    read(ascii(names, rows));
    return warnings_.text();
  };
  EXPECT_EQ(warning(gaussian_names), "");
  std::vector<std::string> others = gaussian_names;
  others[6] = "alpha";
  for (std::size_t i = 0; i < 3; ++i) others[7 + i] = fmt::format("scaling_{}", i);
  for (std::size_t i = 0; i < 4; ++i) others[10 + i] = fmt::format("rotation_{}", i);
  const std::string all = warning(others);
  EXPECT_NE(all.find("without opacity"), std::string::npos) << all;
  EXPECT_NE(all.find("without scale_*"), std::string::npos) << all;
  EXPECT_NE(
      all.find("not read: alpha, scaling_0, scaling_1, scaling_2, rotation_0, rotation_1, rotation_2, rotation_3"),
      std::string::npos)
      << all;
  others = gaussian_names;
  others[10] = "qw", others[11] = "qx", others[12] = "qy", others[13] = "qz";
  EXPECT_NE(warning(others).find("without rot_*, none is turned; not read: qw, qx, qy, qz"), std::string::npos);
  others.assign(gaussian_names.begin(), gaussian_names.begin() + 8);  // one scale for all axes
  EXPECT_EQ(warning(others), "");
}

TEST_F(PlyKinds, OpacityOfWholeNumbersIsItself) {
  for (const auto& [type, most] : {std::pair{"uchar", 255}, {"ushort", 65535}}) {
    std::string text = ascii(gaussian_names, {{0, 0, 0, 0, 0, 0, static_cast<double>(most), -3, -3, -3, 1, 0, 0, 0},
                                              {0, 0, 0, 0, 0, 0, 51.0 * most / 255, -3, -3, -3, 1, 0, 0, 0}});
    text.replace(text.find("float opacity"), 5, type);
    const Gaussians g = read(text);
    EXPECT_FLOAT_EQ(g.opacities[0], 1) << type;
    EXPECT_FLOAT_EQ(g.opacities[1], 0.2f) << type;
    EXPECT_EQ(warnings_.text(), "");
  }
}

}  // namespace
}  // namespace vsplat

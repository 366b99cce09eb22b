// Damaged PlayCanvas compressed PLY files, and those that only the ASCII form shows to be right.
#include "model/io/scene/compressed_ply.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <cmath>

#include "model/io/scene/ply.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

struct File {
  std::string chunks = "element chunk 1\n", vertices = "element vertex 2\n", sh;
  std::string type = "uint", sh_type = "uchar";
  std::vector<double> bounds{-1, -2, -3, 1, 2, 3, -5, -5, -5, -4, -4, -4, 0, 0, 0, 1, 1, 1};
  // Rotations with w the largest: the others are the middle of their range, nearly 0.
  std::string rows = "0 537395712 0 255\n4294967295 537395712 4294967295 4294967040\n", sh_rows;
  std::string skip;  // a property that is left out

  std::string text() const {
    std::string out = "ply\nformat ascii 1.0\n" + chunks;
    for (const char* name : compressed_ply::kBounds)
      if (name != skip) out += fmt::format("property float {}\n", name);
    out += vertices;
    for (const char* name : compressed_ply::kPacked)
      if (name != skip) out += fmt::format("property {} {}\n", type, name);
    if (!sh.empty()) {
      out += sh;
      for (int i = 0; i < 9; ++i) out += fmt::format("property {} f_rest_{}\n", sh_type, i);
    }
    return out + "end_header\n" + fmt::format("{}\n", fmt::join(bounds, " ")) + rows + sh_rows;
  }
};

Gaussians read(const File& file, SkippedGaussians* skipped = nullptr) {
  const std::string text = file.text();
  return read_ply("a.ply", std::as_bytes(std::span(text)), skipped).gaussians;
}

void expect_refused(const File& file, std::vector<std::string> words) {
  words.emplace_back("a.ply");
  test::expect_error(Status::format, words, [&] { read(file); });
}

TEST(CompressedPly, EndsOfTheRangesAreTheBounds) {
  File file;
  file.sh = "element sh 2\n";
  file.sh_rows = "0 1 2 3 4 5 6 7 8\n255 254 128 127 0 0 0 0 0\n";
  const Gaussians g = read(file);
  EXPECT_EQ(g.means, (std::vector<float>{-1, -2, -3, 1, 2, 3}));
  EXPECT_EQ(g.opacities, (std::vector<float>{1, 0}));
  EXPECT_FLOAT_EQ(g.scales[0], std::exp(-5.0f));
  EXPECT_FLOAT_EQ(g.scales[5], std::exp(-4.0f));
  EXPECT_NEAR(g.quats[0], 1, 1e-5);
  ASSERT_EQ(g.sh_degree, 1);
  EXPECT_FLOAT_EQ(g.sh[0], static_cast<float>(-0.5 / kShC0));
  EXPECT_FLOAT_EQ(g.sh[3], -4) << "red of the first coefficient, from byte 0";
  EXPECT_FLOAT_EQ(g.sh[4], (3.5f / 256 - 0.5f) * 8) << "green";
  EXPECT_FLOAT_EQ(g.sh[12 + 3], 4) << "from byte 255";
}

TEST(CompressedPly, DamageIsAnError) {
  EXPECT_EQ(read(File()).count, 2u);
  File file;
  file.chunks = "element chunk 2\n";
  file.bounds.resize(36);
  expect_refused(file, {"element chunk: 2", "2 Gaussians need 1"});
  for (const char* name : {"max_scale_y", "packed_scale", "max_g"}) {
    File without;
    without.skip = name;
    expect_refused(without, {"no property", name});
  }
  File floats;
  floats.type = "float";
  expect_refused(floats, {"packed_position is no uint"});
  File sh;
  sh.sh = "element sh 3\n";
  sh.sh_rows = "0 0 0 0 0 0 0 0 0\n0 0 0 0 0 0 0 0 0\n0 0 0 0 0 0 0 0 0\n";
  expect_refused(sh, {"element sh: 3 rows for 2 Gaussians"});
  sh.sh = "element sh 2\n";
  sh.sh_type = "float";
  expect_refused(sh, {"f_rest_0 is no uchar"});
  File many;
  many.vertices = "element vertex 4000000000\n";
  many.chunks = "element chunk 15625000\n";
  expect_refused(many, {"the header promises"});
}

TEST(CompressedPly, BadBoundsSpoilTheirBlock) {
  File file;
  file.bounds[4] = std::nan("");
  expect_refused(file, {"Gaussian 0, max_y of its chunk 0 (byte", "NaN"});
  SkippedGaussians skipped;
  const test::Warnings warnings;
  EXPECT_EQ(read(file, &skipped).count, 0u);
  EXPECT_EQ(skipped.not_finite, 2u);
  File huge;
  huge.bounds[9] = 100;
  expect_refused(huge, {"Gaussian 1, packed_scale (byte", "beyond what a float holds"});
  EXPECT_EQ(read(huge, &skipped).count, 1u);
  EXPECT_EQ(skipped.huge_scale, 1u);
}

}  // namespace
}  // namespace vsplat

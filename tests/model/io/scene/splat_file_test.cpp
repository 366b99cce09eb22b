// Damaged .splat files.
#include "model/io/scene/splat_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "tests/support/golden_file.h"
#include "tests/support/refusal.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

std::string good_file() { return test::contents_of(test::golden_file("scenes/plain.splat")); }

std::string with_float(std::string bytes, std::size_t at, float value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
  return bytes;
}

Scene read(const std::string& bytes, SkippedGaussians* skipped = nullptr) {
  return read_splat("a.splat", std::as_bytes(std::span(bytes)), skipped);
}

void expect_refused(const std::string& bytes, std::vector<std::string> words) {
  words.emplace_back("a.splat");
  test::expect_error(Status::format, words, [&] { read(bytes); });
}

TEST(SplatFile, BadGaussiansAreErrorsOrCounted) {
  constexpr float inf = std::numeric_limits<float>::infinity();
  const std::string good = good_file();
  expect_refused("", {"empty"});
  expect_refused(good.substr(0, 100), {"100 bytes", "32 for each", "after 3 of them"});
  expect_refused(with_float(good, 32 + 4, NAN), {"Gaussian 1, position 1 (byte 36)", "NaN", "finite"});
  expect_refused(with_float(good, 64 + 20, inf), {"Gaussian 2, scale 2 (byte 84)", "infinity"});
  expect_refused(with_float(good, 64 + 12, -1), {"Gaussian 2, scale 0 (byte 76)", "-1", "from 0 up"});
  std::string still = good;
  std::memset(still.data() + 96 + 28, 128, 4);
  expect_refused(still, {"Gaussian 3, rotation (byte 124)", "zero"});
  SkippedGaussians skipped;
  const test::Warnings warnings;
  EXPECT_EQ(read(with_float(still, 0, NAN), &skipped).gaussians.count, 7u);
  EXPECT_EQ(skipped.not_finite, 1u);
  EXPECT_EQ(skipped.zero_rotation, 1u);
  EXPECT_NE(warnings.text().find("2 of 9 Gaussians are left out"), std::string::npos) << warnings.text();
}

TEST(SplatFile, CountsOnlyColoursThatAByteCannotHold) {
  Scene scene;
  scene.gaussians = test::make_scene({"", 3, 0, 0, 0, ""}, 1);
  const auto coefficient = [](double colour) { return static_cast<float>((colour - 0.5) / kShC0); };
  const double edge = 1e-6;  // rounded, as all are
  for (std::size_t i = 0; i < 9; ++i) scene.gaussians.sh[i] = coefficient(i % 2 ? -edge : 1 + edge);
  for (const std::string& line : splat_rounding(scene)) EXPECT_EQ(line.find("clamped"), line.npos) << line;
  scene.gaussians.sh[4] = coefficient(1.25);
  EXPECT_EQ(splat_rounding(scene).back(), "1 colour value outside 0 to 1 is clamped to it");
}

TEST(SplatFile, IsKnownByItsRotations) {
  const auto known = [](const std::string& bytes) { return is_splat(std::as_bytes(std::span(bytes))); };
  EXPECT_TRUE(known(good_file()));
  EXPECT_FALSE(known(std::string(320, '\0')));
  EXPECT_FALSE(known(std::string(320, 'a')));
  EXPECT_FALSE(known(good_file().substr(1)));
  EXPECT_FALSE(known("short"));
}

}  // namespace
}  // namespace vsplat

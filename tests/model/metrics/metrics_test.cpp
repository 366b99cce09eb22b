#include "model/metrics/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "runtime/error.h"
#include "tests/support/golden.h"

namespace vsplat {
namespace {

TEST(Psnr, IsTheUsualFormula) {
  Image a(5, 3, 3, 0.5f), b(5, 3, 3, 0.6f);
  EXPECT_NEAR(psnr(a, b), 20, 1e-4);
  b = a;
  EXPECT_TRUE(std::isinf(psnr(a, b)));
  b.data[7] = 1.0f;  // one of 45 values is 0.5 off
  EXPECT_NEAR(psnr(a, b), 10 * std::log10(45 / 0.25), 1e-9);
  b.data[3] = std::nanf("");
  EXPECT_TRUE(std::isnan(psnr(a, b)));
}

TEST(Psnr, RefusesOtherSizes) {
  EXPECT_THROW(psnr(Image(2, 3, 3), Image(3, 2, 3)), Error);
  EXPECT_THROW(psnr(Image(2, 3, 3), Image(2, 3, 1)), Error);
  EXPECT_THROW(psnr(Image(), Image()), Error);
}

// The pictures of a golden file compared with its inputs: mean over all of them.
TEST(Metrics, AreThoseOfTheReference) {
  for (const char* name : {"micro", "micro_noise"}) {
    const test::Golden golden = test::Golden::load(name);
    const HostTensor drawn = golden.tensor("render.final.image"), given = golden.tensor("input.images");
    ASSERT_EQ(drawn.shape, given.shape);
    const int count = static_cast<int>(drawn.shape[0]), side = static_cast<int>(drawn.shape[1]);
    Image all_drawn(side, side * count, 3), all_given = all_drawn;
    all_drawn.data = drawn.data, all_given.data = given.data;
    for (float& v : all_drawn.data) v = std::clamp(v, 0.0f, 1.0f);
    EXPECT_NEAR(psnr(all_drawn, all_given), golden.floats("psnr")[0], 1e-4);
    double sum = 0;
    for (int i = 0; i < count; ++i) {
      Image a(side, side, 3), b(side, side, 3);
      std::copy_n(all_drawn.at(0, i * side), a.data.size(), a.data.begin());
      std::copy_n(all_given.at(0, i * side), b.data.size(), b.data.begin());
      sum += ssim(a, b);
    }
    EXPECT_NEAR(sum / count, golden.floats("ssim")[0], 1e-5);
  }
}

// A picture of pseudo-random colours from 0.1 to 0.9.
Image colours(int width, int height) {
  Image out(width, height, 3);
  for (std::size_t i = 0; i < out.data.size(); ++i)
    out.data[i] = 0.1f + 0.8f * static_cast<float>(i * 7919 % 101) / 100.0f;
  return out;
}

TEST(PsnrCc, FindsTheMapOfColours) {
  const Image drawn = colours(9, 7);
  Image given = drawn;
  for (std::size_t i = 0; i < given.data.size(); i += 3) {
    const float r = drawn.data[i], g = drawn.data[i + 1], b = drawn.data[i + 2];
    given.data[i] = 0.6f * r + 0.1f * g + 0.1f, given.data[i + 1] = 0.9f * g, given.data[i + 2] = 0.5f * b + 0.3f * r;
  }
  EXPECT_LT(psnr(drawn, given), 20);
  EXPECT_GT(psnr_cc(drawn, given), 110);
  // One value off by 0.1: the map of least squares takes up a part of it.
  given.data[10] += 0.1f;
  const double alone = 10 * std::log10(static_cast<double>(given.data.size()) / 0.01);
  EXPECT_GT(psnr_cc(drawn, given), alone);
  EXPECT_LT(psnr_cc(drawn, given), alone + 1);
}

TEST(PsnrCc, ClampsAfterTheMap) {
  // Two greys, the second picture's beyond the map of least squares through the others: clamping brings it back to 1.
  Image drawn(4, 1, 3), given(4, 1, 3);
  const float from[] = {0.0f, 0.5f, 0.5f, 1.0f}, to[] = {0.0f, 1.0f, 1.0f, 1.0f};
  for (std::size_t i = 0; i < 12; ++i) drawn.data[i] = from[i / 3], given.data[i] = to[i / 3];
  // Slope 1 and offset 0.25: 0.25, 0.75, 0.75, 1.25, of which the last becomes 1.
  EXPECT_NEAR(psnr_cc(drawn, given), -10 * std::log10((3 * 0.0625) / 4), 1e-6);
}

TEST(PsnrCc, IsOfTheKnownPixels) {
  const Image drawn = colours(8, 5);
  Image given = drawn;
  for (float& v : given.data) v = 0.5f * v + 0.2f;
  std::vector<std::uint8_t> known(40, 1);
  for (std::size_t i = 30; i < 40; ++i) {
    known[i] = 0;
    for (std::size_t c = 0; c < 3; ++c) given.data[3 * i + c] = i % 2 ? 1.0f : 0.0f;
  }
  EXPECT_LT(psnr_cc(drawn, given), 15);
  EXPECT_GT(psnr_cc(drawn, given, known), 110);
  EXPECT_TRUE(std::isnan(psnr_cc(drawn, given, std::vector<std::uint8_t>(40, 0))));
  EXPECT_THROW(psnr_cc(drawn, given, std::vector<std::uint8_t>(39, 1)), Error);
  EXPECT_THROW(psnr_cc(drawn, colours(5, 8)), Error);
  EXPECT_THROW(psnr_cc(Image(2, 2, 1), Image(2, 2, 1)), Error);
}

TEST(PsnrCc, OfColoursThatDetermineNoMap) {
  const Image given = colours(6, 6);
  Image mean(6, 6, 3);
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0;
    for (std::size_t i = c; i < given.data.size(); i += 3) sum += given.data[i];
    for (std::size_t i = c; i < given.data.size(); i += 3) mean.data[i] = static_cast<float>(sum / 36);
  }
  EXPECT_NEAR(psnr_cc(Image(6, 6, 3, 0.25f), given), psnr(mean, given), 1e-4);
  Image broken = given;
  broken.data[40] = std::nanf("");
  EXPECT_TRUE(std::isnan(psnr_cc(given, broken)));
  EXPECT_TRUE(std::isnan(psnr_cc(broken, given)));
}

// The formula with a two-dimensional window, on noise, in a rectangular picture.
TEST(Ssim, IsTheUsualFormula) {
  const int w = 14, h = 13;
  Image a(w, h, 2), b(w, h, 2);
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    a.data[i] = static_cast<float>(i * 7919 % 101) / 100.0f;
    b.data[i] = 0.7f * a.data[i] + 0.2f * static_cast<float>(i * 104729 % 97) / 96.0f;
  }
  double norm = 0, total = 0;
  for (int v = -5; v <= 5; ++v)
    for (int u = -5; u <= 5; ++u) norm += std::exp(-(u * u + v * v) / 4.5);
  for (int c = 0; c < 2; ++c)
    for (int y = 5; y < h - 5; ++y)
      for (int x = 5; x < w - 5; ++x) {
        double ma = 0, mb = 0, va = 0, vb = 0, cab = 0;
        for (int pass = 0; pass < 2; ++pass)
          for (int v = -5; v <= 5; ++v)
            for (int u = -5; u <= 5; ++u) {
              const double k = std::exp(-(u * u + v * v) / 4.5) / norm, p = a.at(x + u, y + v)[c],
                           q = b.at(x + u, y + v)[c];
              if (pass == 0) {
                ma += k * p, mb += k * q;
              } else {
                va += k * (p - ma) * (p - ma), vb += k * (q - mb) * (q - mb), cab += k * (p - ma) * (q - mb);
              }
            }
        total += (2 * ma * mb + 1e-4) * (2 * cab + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
      }
  EXPECT_NEAR(ssim(a, b), total / (4 * 3 * 2), 1e-9);
  EXPECT_NEAR(ssim(a, a), 1, 1e-12);
}

TEST(Ssim, NeedsAWindow) {
  EXPECT_TRUE(std::isnan(ssim(Image(10, 50, 3), Image(10, 50, 3))));
  EXPECT_TRUE(std::isnan(ssim(Image(50, 10, 3), Image(50, 10, 3))));
  EXPECT_EQ(ssim(Image(11, 11, 3), Image(11, 11, 3)), 1);
  EXPECT_THROW(ssim(Image(20, 30, 3), Image(30, 20, 3)), Error);
  EXPECT_THROW(ssim(Image(), Image()), Error);
}

TEST(AbsoluteDifference, IsOfEveryValue) {
  Image a(2, 1, 1), b(2, 1, 1);
  a.data = {0.25f, 1.0f}, b.data = {0.75f, 0.5f};
  EXPECT_EQ(absolute_difference(a, b).data, (std::vector<float>{0.5f, 0.5f}));
  EXPECT_THROW(absolute_difference(a, Image(1, 2, 1)), Error);
}

}  // namespace
}  // namespace vsplat

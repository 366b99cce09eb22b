// Codebooks, palettes and the Morton order of scene files.
#include "model/io/scene/codebook.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "model/io/scene/morton_order.h"
#include "model/io/scene/sh_palette.h"

namespace vsplat {
namespace {

double error_of(const Codebook& book, const std::vector<float>& numbers) {
  double out = 0;
  for (const float v : numbers) out += std::pow(static_cast<double>(v) - book.values()[book.nearest(v)], 2);
  return out;
}

std::vector<float> normal_numbers(std::size_t count, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<float> normal;
  std::vector<float> out(count);
  for (float& v : out) v = normal(engine);
  return out;
}

TEST(Codebook, KeepsFewNumbersExactly) {
  std::vector<float> numbers;
  numbers.reserve(1000);
  for (int i = 0; i < 1000; ++i) numbers.push_back(static_cast<float>(std::sqrt(i % 256)));
  EXPECT_EQ(error_of(Codebook(numbers), numbers), 0);
  const Codebook one({3, 3});
  EXPECT_EQ(one.values()[one.nearest(100)], 3);
}

// Against the optimum by dynamic programming without any shortcut.
TEST(Codebook, HasTheLeastSquaredError) {
  std::vector<float> numbers = normal_numbers(320, 1);
  const double found = error_of(Codebook(numbers), numbers);
  std::sort(numbers.begin(), numbers.end());
  const std::size_t n = numbers.size();
  std::vector<double> sum(n + 1), square(n + 1);
  for (std::size_t i = 0; i < n; ++i) {
    sum[i + 1] = sum[i] + numbers[i];
    square[i + 1] = square[i] + static_cast<double>(numbers[i]) * numbers[i];
  }
  std::vector<double> best(n + 1, std::numeric_limits<double>::infinity());
  best[0] = 0;
  for (int entry = 0; entry < 256; ++entry)
    for (std::size_t end = n; end > 0; --end)
      for (std::size_t begin = 0; begin < end; ++begin) {
        const double s = sum[end] - sum[begin];
        best[end] =
            std::min(best[end], best[begin] + square[end] - square[begin] - s * s / static_cast<double>(end - begin));
      }
  EXPECT_NEAR(found, best[n], 1e-6 * best[n] + 1e-9);
}

// One number far away takes an entry, and leaves the others theirs.
TEST(Codebook, IsNotSpoiltByOutliers) {
  std::vector<float> numbers = normal_numbers(100000, 2);
  const double alone = error_of(Codebook(numbers), numbers);
  std::vector<float> more = numbers;
  more.push_back(1e6f);
  more.push_back(-1e6f);
  EXPECT_LT(error_of(Codebook(more), numbers), 1.2 * alone);
  // An even grid over the numbers' range does worse.
  const auto [low, high] = std::minmax_element(numbers.begin(), numbers.end());
  EXPECT_LT(alone / 1e5, std::pow((*high - *low) / 256, 2) / 12);
}

TEST(ShPalette, SizesAreThoseOfOtherWriters) {
  const std::pair<std::size_t, std::size_t> expected[] = {
      {1, 1}, {1023, 1023}, {1024, 1024}, {2047, 1024}, {2048, 2048}, {89292, 65536}, {65535, 32768}, {1000000, 65536}};
  for (const auto& [count, size] : expected) EXPECT_EQ(sh_palette_size(count), size) << count;
}

double error_of(const ShPalette& palette, const std::vector<float>& vectors) {
  double out = 0;
  for (std::size_t k = 0; k < palette.labels.size(); ++k)
    for (std::size_t i = 0; i < palette.width; ++i)
      out += std::pow(vectors[k * palette.width + i] - palette.centroids[palette.labels[k] * palette.width + i], 2);
  return out;
}

TEST(ShPalette, KeepsFewVectorsExactly) {
  const std::vector<float> different = normal_numbers(40 * 9, 3);
  std::vector<float> vectors;
  for (std::size_t k = 0; k < 1000; ++k)
    vectors.insert(vectors.end(), &different[k * 7 % 40 * 9], &different[k * 7 % 40 * 9] + 9);
  const ShPalette palette = make_sh_palette(vectors, 9, 200);
  EXPECT_EQ(palette.size(), 200u);
  EXPECT_LT(error_of(palette, vectors), 1e-8);
  // As many centroids as vectors.
  EXPECT_LT(error_of(make_sh_palette(different, 9, 40), different), 1e-12);
}

TEST(ShPalette, FindsClusters) {
  const std::vector<float> centres = normal_numbers(900 * 9, 4), noise = normal_numbers(9000 * 9, 5);
  std::vector<float> vectors(noise.size());
  for (std::size_t k = 0; k < 9000; ++k)
    for (std::size_t i = 0; i < 9; ++i) vectors[9 * k + i] = centres[k % 900 * 9 + i] + 0.01f * noise[9 * k + i];
  double variance = 0;
  for (const float v : vectors) variance += static_cast<double>(v) * v;
  const ShPalette palette = make_sh_palette(vectors, 9, 1024);
  EXPECT_LT(error_of(palette, vectors), 0.02 * variance);
  EXPECT_EQ(make_sh_palette(vectors, 9, 1024).labels, palette.labels);
}

TEST(MortonOrder, InterleavesBits) {
  std::mt19937 engine(6);
  std::vector<std::array<std::uint16_t, 3>> points(500);
  for (auto& p : points)
    for (auto& v : p) v = static_cast<std::uint16_t>(engine() >> (engine() % 16));
  points[100] = points[200];
  const auto key = [&](std::uint32_t i) {
    std::uint64_t out = 0;
    for (int bit = 15; bit >= 0; --bit)
      for (std::size_t axis = 3; axis-- > 0;) out = out << 1 | (points[i][axis] >> bit & 1);
    return out;
  };
  const std::vector<std::uint32_t> order = morton_order(points);
  EXPECT_EQ(std::set<std::uint32_t>(order.begin(), order.end()).size(), points.size());
  for (std::size_t i = 1; i < order.size(); ++i)
    EXPECT_TRUE(key(order[i - 1]) < key(order[i]) || (key(order[i - 1]) == key(order[i]) && order[i - 1] < order[i]));
}

}  // namespace
}  // namespace vsplat

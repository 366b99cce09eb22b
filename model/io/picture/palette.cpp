#include "model/io/picture/palette.h"

#include <algorithm>
#include <climits>
#include <cmath>

namespace vsplat {
namespace {

using Colour = IndexedPicture::Colour;

constexpr std::size_t most_colours = 256;

// Pixels that become one colour; `axis` is the channel in which they differ most.
struct Box {
  Colour *begin, *end;
  std::array<double, 3> mean{};
  std::size_t axis = 0;
  double error = 0;  // squared, in `axis`

  Box(Colour* from, Colour* to) : begin(from), end(to) {
    std::array<double, 3> squares{};
    for (const Colour* p = begin; p != end; ++p)
      for (std::size_t c = 0; c < 3; ++c) mean[c] += (*p)[c], squares[c] += (*p)[c] * (*p)[c];
    const auto count = static_cast<double>(end - begin);
    for (std::size_t c = 0; c < 3; ++c) {
      mean[c] /= count;
      const double off = squares[c] - count * mean[c] * mean[c];
      if (off > error) axis = c, error = off;
    }
  }
};

// Splits the box with the largest error at its mean until there are enough (median cut with variances).
std::vector<Colour> palette_of(std::vector<Colour> pixels) {
  std::vector<Colour> out{pixels[0]};
  std::vector<Box> boxes{Box(pixels.data(), pixels.data() + pixels.size())};
  while (boxes.size() + out.size() < most_colours) {
    Box& worst = *std::max_element(boxes.begin(), boxes.end(), [](auto& a, auto& b) { return a.error < b.error; });
    if (worst.error < 0.25) break;  // all have one colour: the rest is rounding
    Colour* const upper = std::partition(worst.begin, worst.end,
                                         [&](const Colour& p) { return p[worst.axis] <= worst.mean[worst.axis]; });
    Colour* const end = worst.end;
    worst = Box(worst.begin, upper);
    boxes.emplace_back(upper, end);
  }
  for (const Box& box : boxes) {
    Colour& colour = out.emplace_back();
    for (std::size_t c = 0; c < 3; ++c) colour[c] = static_cast<std::uint8_t>(std::lround(box.mean[c]));
  }
  return out;
}

}  // namespace

IndexedPicture indexed(const std::vector<Colour>& pixels, int width) {
  IndexedPicture out{palette_of(pixels), std::vector<std::uint8_t>(pixels.size())};
  std::vector<int> nearest(std::size_t{1} << 18, -1);  // by the upper 6 bits of each channel
  const auto find = [&](const std::array<int, 3>& v) {
    const int key = (v[0] >> 2 << 12) + (v[1] >> 2 << 6) + (v[2] >> 2);
    int& found = nearest[static_cast<std::size_t>(key)];
    if (found >= 0) return static_cast<std::size_t>(found);
    int least = INT_MAX;
    for (std::size_t i = 0; i < out.palette.size(); ++i) {
      int off = 0;
      for (std::size_t c = 0; c < 3; ++c) off += (v[c] - out.palette[i][c]) * (v[c] - out.palette[i][c]);
      if (off < least) least = off, found = static_cast<int>(i);
    }
    return static_cast<std::size_t>(found);
  };
  const auto row = static_cast<std::size_t>(width);
  std::vector<std::array<float, 3>> here(row), below(row);  // of the rows of `i` and after it
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::size_t x = i % row;
    if (x == 0 && i > 0) {
      here.swap(below);
      std::fill(below.begin(), below.end(), std::array<float, 3>{});
    }
    if (pixels[i] == out.palette[0]) continue;
    std::array<int, 3> wanted{};
    for (std::size_t c = 0; c < 3; ++c)
      wanted[c] = std::clamp(static_cast<int>(std::lround(static_cast<float>(pixels[i][c]) + here[x][c])), 0, 255);
    const std::size_t index = find(wanted);
    out.pixels[i] = static_cast<std::uint8_t>(index);
    for (std::size_t c = 0; c < 3; ++c) {
      const float e = static_cast<float>(wanted[c] - out.palette[index][c]) / 16;
      below[x][c] += 5 * e;
      if (x > 0) below[x - 1][c] += 3 * e;
      if (x + 1 < row) here[x + 1][c] += 7 * e, below[x + 1][c] += e;
    }
  }
  return out;
}

}  // namespace vsplat

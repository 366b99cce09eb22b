#include "model/pictures/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "runtime/fail.h"

namespace vsplat {
namespace {

void check_alike(const Image& a, const Image& b) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels || a.empty())
    fail(Status::input, "pictures of {} x {} x {} and {} x {} x {} cannot be compared", a.width, a.height, a.channels,
         b.width, b.height, b.channels);
}

using Window = std::array<double, ssim_window>;

Window gaussian_window() {
  constexpr double sigma = 1.5;
  constexpr int middle = ssim_window / 2;
  Window out{};
  double sum = 0;
  for (int i = 0; i < ssim_window; ++i) {
    const double d = i - middle;
    sum += out[i] = std::exp(-d * d / (2 * sigma * sigma));
  }
  for (double& w : out) w /= sum;
  return out;
}

// Weighted sums of a, b, a a, b b, a b over a window.
using Moments = std::array<double, 5>;

double similarity(const Moments& m) {
  constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  const double ma = m[0], mb = m[1], va = m[2] - ma * ma, vb = m[3] - mb * mb, cab = m[4] - ma * mb;
  return (2 * ma * mb + c1) / (ma * ma + mb * mb + c1) * (2 * cab + c2) / (va + vb + c2);
}

// One row of one channel, blurred along x: what the windows that begin at each pixel have of it.
void blur_row(const Window& window, const float* a, const float* b, int channels, std::vector<Moments>& out) {
  for (std::size_t x = 0; x < out.size(); ++x) {
    Moments sum{};
    for (std::size_t i = 0; i < window.size(); ++i) {
      const double p = a[(x + i) * channels], q = b[(x + i) * channels], w = window[i];
      sum[0] += w * p, sum[1] += w * q, sum[2] += w * p * p, sum[3] += w * q * q, sum[4] += w * p * q;
    }
    out[x] = sum;
  }
}

}  // namespace

double psnr(const Image& a, const Image& b) {
  check_alike(a, b);
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    const double d = static_cast<double>(a.data[i]) - b.data[i];
    sum += d * d;
  }
  return -10 * std::log10(sum / static_cast<double>(a.data.size()));
}

double ssim(const Image& a, const Image& b) {
  check_alike(a, b);
  if (std::min(a.width, a.height) < ssim_window) return std::numeric_limits<double>::quiet_NaN();
  const Window window = gaussian_window();
  const int columns = a.width - ssim_window + 1, rows = a.height - ssim_window + 1;
  // The last rows, row y at y modulo the window's side: two pictures of 4K need no more memory than that.
  std::array<std::vector<Moments>, ssim_window> blurred;
  blurred.fill(std::vector<Moments>(static_cast<std::size_t>(columns)));
  double total = 0;
  for (int c = 0; c < a.channels; ++c)
    for (int y = 0; y < a.height; ++y) {
      blur_row(window, a.at(0, y) + c, b.at(0, y) + c, a.channels, blurred[y % ssim_window]);
      const int top = y - ssim_window + 1;
      for (int x = 0; top >= 0 && x < columns; ++x) {
        Moments sum{};
        for (int i = 0; i < ssim_window; ++i) {
          const Moments& row = blurred[(top + i) % ssim_window][x];
          for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += window[i] * row[k];
        }
        total += similarity(sum);
      }
    }
  return total / (static_cast<double>(columns) * rows * a.channels);
}

Image absolute_difference(const Image& a, const Image& b) {
  check_alike(a, b);
  Image out(a.width, a.height, a.channels);
  std::transform(a.data.begin(), a.data.end(), b.data.begin(), out.data.begin(),
                 [](float p, float q) { return std::abs(p - q); });
  return out;
}

}  // namespace vsplat

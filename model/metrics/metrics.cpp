#include "model/metrics/metrics.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <future>
#include <limits>
#include <vector>

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

// A row of weighted sums over windows: of a, b, a a + b b, a b. Each moment has a row of its own, so that the loops
// below run along it.
constexpr int moments = 4;
using Row = std::array<std::vector<double>, moments>;

// out[x] is the weighted sum of at[0][x], at[1][x], ...; the window is symmetric.
void blur(const Window& window, const std::array<const double*, ssim_window>& at, std::vector<double>& out) {
  constexpr int middle = ssim_window / 2;
  const std::size_t n = out.size();
  double* const to = out.data();
  for (std::size_t x = 0; x < n; ++x) to[x] = window[middle] * at[middle][x];
  for (int i = 0; i < middle; ++i) {
    const double w = window[i];
    const double *a = at[i], *b = at[ssim_window - 1 - i];
    for (std::size_t x = 0; x < n; ++x) to[x] += w * (a[x] + b[x]);
  }
}

// Blurs one row of one channel along x: the contribution of this row to the windows that begin at each pixel. `line` is
// scratch memory.
void blur_row(const Window& window, const float* a, const float* b, int channels, Row& line, Row& out) {
  for (std::size_t x = 0; x < line[0].size(); ++x) {
    const double p = a[x * channels], q = b[x * channels];
    line[0][x] = p, line[1][x] = q, line[2][x] = p * p + q * q, line[3][x] = p * q;
  }
  for (int k = 0; k < moments; ++k) {
    std::array<const double*, ssim_window> at{};
    for (int i = 0; i < ssim_window; ++i) at[i] = line[k].data() + i;
    blur(window, at, out[k]);
  }
}

double similarity(const Row& m) {
  constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  double out = 0;
  for (std::size_t x = 0; x < m[0].size(); ++x) {
    const double ma = m[0][x], mb = m[1][x], squares = ma * ma + mb * mb, product = 2 * ma * mb;
    out += (product + c1) * (2 * m[3][x] - product + c2) / ((squares + c1) * (m[2][x] - squares + c2));
  }
  return out;
}

Row row_of(std::size_t size) {
  Row out;
  out.fill(std::vector<double>(size));
  return out;
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

namespace {

// The pixels of a picture that are known, without a list of them.
struct KnownPixels {
  std::size_t all, count;  // of the picture, and those that are known
  std::span<const std::uint8_t> known;

  KnownPixels(std::size_t pixels, std::span<const std::uint8_t> known_or_none)
      : all(pixels),
        count(known_or_none.empty() ? pixels : pixels - std::count(known_or_none.begin(), known_or_none.end(), 0)),
        known(known_or_none) {}

  template <class F>
  void for_each(const F& use) const {
    for (std::size_t i = 0; i < all; ++i)
      if (known.empty() || known[i] != 0) use(i);
  }
};

struct ColourMap {
  Eigen::Matrix3d factors;
  Eigen::Vector3d offsets;

  Eigen::Vector3d of(const Eigen::Vector3d& colour) const {
    return (factors * colour + offsets).cwiseMax(0.0).cwiseMin(1.0);
  }
};

Eigen::Vector3d colour_at(const Image& image, std::size_t pixel) {
  return Eigen::Map<const Eigen::Vector3f>(&image.data[3 * pixel]).cast<double>();
}

// The map of least squares, in deviations from the means, which keeps the normal equations well conditioned.
ColourMap nearest_map(const Image& drawn, const Image& given, const KnownPixels& pixels) {
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = from;
  pixels.for_each([&](std::size_t i) { from += colour_at(drawn, i), to += colour_at(given, i); });
  from /= static_cast<double>(pixels.count), to /= static_cast<double>(pixels.count);
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero(), products = squares;
  pixels.for_each([&](std::size_t i) {
    const Eigen::Vector3d d = colour_at(drawn, i) - from;
    squares += d * d.transpose();
    products += d * (colour_at(given, i) - to).transpose();
  });
  Eigen::CompleteOrthogonalDecomposition<Eigen::Matrix3d> solver;
  solver.setThreshold(1e-9);  // a colour direction with less variance, relative to the largest, is rounding
  ColourMap out;
  out.factors = solver.compute(squares).solve(products).transpose();
  out.offsets = to - out.factors * from;
  return out;
}

}  // namespace

double psnr_cc(const Image& drawn, const Image& given, std::span<const std::uint8_t> known) {
  check_alike(drawn, given);
  const std::size_t count = drawn.data.size() / static_cast<std::size_t>(drawn.channels);
  if (drawn.channels != 3 || (!known.empty() && known.size() != count))
    fail(Status::input, "a colour map needs pictures of 3 channels, and {} known pixels or none: found {} and {}",
         count, drawn.channels, known.size());
  const KnownPixels pixels(count, known);
  if (pixels.count == 0) return std::numeric_limits<double>::quiet_NaN();
  const ColourMap map = nearest_map(drawn, given, pixels);
  // NaN makes the offsets NaN, which clamping might hide.
  if (map.offsets.hasNaN()) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0;
  pixels.for_each([&](std::size_t i) { sum += (map.of(colour_at(drawn, i)) - colour_at(given, i)).squaredNorm(); });
  return -10 * std::log10(sum / (3.0 * static_cast<double>(pixels.count)));
}

namespace {

// The sum of one channel's similarities over all windows.
double summed_similarity(const Image& a, const Image& b, int channel) {
  const Window window = gaussian_window();
  const int columns = a.width - ssim_window + 1;
  // Ring buffer of the last rows: row y is at y modulo the window's side. Two 4K pictures need no more memory than
  // that.
  std::array<Row, ssim_window> blurred;
  blurred.fill(row_of(static_cast<std::size_t>(columns)));
  Row line = row_of(static_cast<std::size_t>(a.width)), sum = blurred[0];
  double total = 0;
  for (int y = 0; y < a.height; ++y) {
    blur_row(window, a.at(0, y) + channel, b.at(0, y) + channel, a.channels, line, blurred[y % ssim_window]);
    const int top = y - ssim_window + 1;
    if (top < 0) continue;
    for (int k = 0; k < moments; ++k) {
      std::array<const double*, ssim_window> at{};
      for (int i = 0; i < ssim_window; ++i) at[i] = blurred[(top + i) % ssim_window][k].data();
      blur(window, at, sum[k]);
    }
    total += similarity(sum);
  }
  return total;
}

}  // namespace

double ssim(const Image& a, const Image& b) {
  check_alike(a, b);
  if (std::min(a.width, a.height) < ssim_window) return std::numeric_limits<double>::quiet_NaN();
  // Channels run in threads if the picture is large enough; their sums are added in order.
  constexpr int worth_a_thread = 1 << 16;
  const auto how = a.width * a.height < worth_a_thread ? std::launch::deferred : std::launch::async;
  std::vector<std::future<double>> sums;
  sums.reserve(static_cast<std::size_t>(a.channels));
  for (int c = 0; c < a.channels; ++c) sums.push_back(std::async(how, [&, c] { return summed_similarity(a, b, c); }));
  double total = 0;
  for (std::future<double>& sum : sums) total += sum.get();
  const double columns = a.width - ssim_window + 1, rows = a.height - ssim_window + 1;
  return total / (columns * rows * a.channels);
}

Image absolute_difference(const Image& a, const Image& b) {
  check_alike(a, b);
  Image out(a.width, a.height, a.channels);
  std::transform(a.data.begin(), a.data.end(), b.data.begin(), out.data.begin(),
                 [](float p, float q) { return std::abs(p - q); });
  return out;
}

}  // namespace vsplat

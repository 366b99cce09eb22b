// The loss on pictures in double, from its definition (Wang et al. 2003, 2004); its gradient is taken by differences.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// One channel of one picture.
struct Plane {
  long height = 0, width = 0;
  std::vector<double> v{};
  double at(long y, long x) const { return v[static_cast<std::size_t>(y * width + x)]; }
};

// Gaussian windows of 11 x 11, sigma 1.5, that lie inside.
inline Plane blur(const Plane& p) {
  std::array<double, 11> g{};
  double sum = 0;
  for (int k = 0; k < 11; ++k) sum += g[static_cast<std::size_t>(k)] = std::exp(-(k - 5) * (k - 5) / 4.5);
  Plane rows{p.height, p.width - 10}, out{p.height - 10, p.width - 10};
  for (long y = 0; y < rows.height; ++y)
    for (long x = 0; x < rows.width; ++x) {
      double value = 0;
      for (int k = 0; k < 11; ++k) value += g[static_cast<std::size_t>(k)] / sum * p.at(y, x + k);
      rows.v.push_back(value);
    }
  for (long y = 0; y < out.height; ++y)
    for (long x = 0; x < out.width; ++x) {
      double value = 0;
      for (int k = 0; k < 11; ++k) value += g[static_cast<std::size_t>(k)] / sum * rows.at(y + k, x);
      out.v.push_back(value);
    }
  return out;
}

inline Plane product(const Plane& a, const Plane& b) {
  Plane out = a;
  for (std::size_t i = 0; i < out.v.size(); ++i) out.v[i] *= b.v[i];
  return out;
}

// The means of SSIM, and of its part of contrast and structure.
inline std::array<double, 2> similarity(const Plane& a, const Plane& b) {
  const Plane ma = blur(a), mb = blur(b), aa = blur(product(a, a)), bb = blur(product(b, b)), ab = blur(product(a, b));
  std::array<double, 2> sum{};
  for (std::size_t i = 0; i < ma.v.size(); ++i) {
    const double x = ma.v[i], y = mb.v[i];
    const double cs = (2 * (ab.v[i] - x * y) + 9e-4) / (aa.v[i] - x * x + bb.v[i] - y * y + 9e-4);
    sum[0] += (2 * x * y + 1e-4) / (x * x + y * y + 1e-4) * cs;
    sum[1] += cs;
  }
  for (double& s : sum) s /= static_cast<double>(ma.v.size());
  return sum;
}

// Means of 2 x 2, with a row (column) of zeros before the first where their number is odd.
inline Plane halve(const Plane& p) {
  Plane out{(p.height + 1) / 2, (p.width + 1) / 2};
  for (long y = 0; y < out.height; ++y)
    for (long x = 0; x < out.width; ++x) {
      double sum = 0;
      for (long v = 2 * y - p.height % 2; v < 2 * y - p.height % 2 + 2; ++v)
        for (long u = 2 * x - p.width % 2; u < 2 * x - p.width % 2 + 2; ++u)
          if (v >= 0 && u >= 0) sum += p.at(v, u);
      out.v.push_back(sum / 4);
    }
  return out;
}

struct LossKind {
  bool absolute = false, single_scale = false, similar = true;
};

// SSIM, or MS-SSIM where both sides exceed 160.
inline double plane_similarity(Plane a, Plane b, const LossKind& kind) {
  if (kind.single_scale || std::min(a.height, a.width) <= 160) return similarity(a, b)[0];
  double product = 1;
  for (const double power : {0.0448, 0.2856, 0.3001, 0.2363, 0.1333}) {
    product *= std::pow(std::max(similarity(a, b)[power == 0.1333 ? 0 : 1], 0.0), power);
    a = halve(a), b = halve(b);
  }
  return product;
}

// For plane i = 3 n + c of pictures and target [N, h, w, 3]: the sum of errors, and the similarity (1 if there is
// none).
// none).
inline std::array<double, 2> plane_loss(const std::vector<double>& pictures, const std::vector<float>& target, long i,
                                        long h, long w, const LossKind& kind) {
  Plane a{h, w}, b{h, w};
  double errors = 0;
  for (long p = 0; p < h * w; ++p) {
    const auto at = static_cast<std::size_t>((i / 3 * h * w + p) * 3 + i % 3);
    a.v.push_back(std::clamp(pictures[at], 0.0, 1.0));
    b.v.push_back(target[at]);
    const double d = a.v.back() - b.v.back();
    errors += kind.absolute ? std::abs(d) : d * d;
  }
  return {errors, kind.similar ? plane_similarity(a, b, kind) : 1};
}

// The loss, the mean error, the similarity.
inline std::array<double, 3> loss(const std::vector<double>& pictures, const std::vector<float>& target, long h, long w,
                                  double weight, const LossKind& kind = {}) {
  const long planes = static_cast<long>(pictures.size()) / (h * w);
  double errors = 0, similar = 0;
  for (long i = 0; i < planes; ++i) {
    const auto one = plane_loss(pictures, target, i, h, w, kind);
    errors += one[0], similar += one[1];
  }
  errors /= static_cast<double>(pictures.size()), similar /= static_cast<double>(planes);
  return {errors + weight * (1 - similar), errors, kind.similar ? similar : 0};
}

// The loss's derivative by number `at` of the pictures, by central differences in its plane (the others do not depend
// on it).
inline double loss_slope(std::vector<double> pictures, const std::vector<float>& target, long h, long w, double weight,
                         std::size_t at, const LossKind& kind = {}) {
  const double step = 1e-5;
  const long n = static_cast<long>(at) / (h * w * 3), plane = 3 * n + static_cast<long>(at) % 3;
  const auto count = static_cast<double>(pictures.size()), planes = count / static_cast<double>(h * w);
  pictures[at] += step;
  const auto up = plane_loss(pictures, target, plane, h, w, kind);
  pictures[at] -= 2 * step;
  const auto down = plane_loss(pictures, target, plane, h, w, kind);
  return ((up[0] - down[0]) / count - weight * (up[1] - down[1]) / planes) / (2 * step);
}

}  // namespace vsplat::ref

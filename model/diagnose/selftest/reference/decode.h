// Raw numbers to Gaussians in double, from the definition.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace vsplat::ref {

struct GaussianLists {
  std::vector<double> means, scales, quats, opacities, sh;
};

inline double logistic(double x) { return 1 / (1 + std::exp(-x)); }

// The scale that a raw number means, and its derivative; `exponential`: LaRa's.
inline double scale_of(double x, double voxel, bool exponential) {
  return exponential ? std::exp(x) * voxel / 3 : std::log1p(std::exp(x + std::log(std::expm1(voxel / 6))));
}
inline double scale_slope(double x, double voxel, bool exponential) {
  return exponential ? std::exp(x) * voxel / 3 : logistic(x + std::log(std::expm1(voxel / 6)));
}

// Appends the Gaussian that `raw` (8 + sh_size + scales numbers) means.
template <class Number>
void decode(const Number* raw, const double anchor[3], double reach, double voxel, long sh_size, GaussianLists& out,
            int scales = 3, bool exponential = false) {
  for (int i = 0; i < 3; ++i) out.means.push_back(anchor[i] + (2 * logistic(raw[i]) - 1) * reach);
  for (long i = 0; i < sh_size; ++i) out.sh.push_back(raw[3 + i]);
  raw += 3 + sh_size;
  out.opacities.push_back(logistic(raw[0] - 2.1792));
  for (int i = 0; i < scales; ++i) out.scales.push_back(scale_of(raw[1 + i], voxel, exponential));
  raw += 1 + scales;
  double norm = 0;
  for (int i = 0; i < 4; ++i) norm += static_cast<double>(raw[i]) * raw[i];
  norm = std::max(std::sqrt(norm), 1e-12);
  for (int i = 0; i < 4; ++i) out.quats.push_back(raw[i] / norm);
}

// Appends the loss by the 8 + sh_size + scales raw numbers, where `d` has that by each Gaussian, of which this is
// number k.
template <class Number>
void decode_backward(const Number* raw, double reach, double voxel, long sh_size, const GaussianLists& d, std::size_t k,
                     std::vector<double>& out, std::size_t scales = 3, bool exponential = false) {
  const auto slope = [](double x) { return std::exp(-std::abs(x)) / std::pow(1 + std::exp(-std::abs(x)), 2); };
  const auto sh = static_cast<std::size_t>(sh_size);
  for (std::size_t i = 0; i < 3; ++i) out.push_back(d.means[3 * k + i] * 2 * reach * slope(raw[i]));
  for (std::size_t i = 0; i < sh; ++i) out.push_back(d.sh[sh * k + i]);
  raw += 3 + sh_size;
  out.push_back(d.opacities[k] * slope(raw[0] - 2.1792));
  for (std::size_t i = 0; i < scales; ++i)
    out.push_back(d.scales[scales * k + i] * scale_slope(raw[1 + i], voxel, exponential));
  raw += 1 + scales;
  double square = 0, along = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    square += static_cast<double>(raw[i]) * raw[i];
    along += d.quats[4 * k + i] * raw[i];
  }
  const bool unit = std::sqrt(square) >= 1e-12;  // else divided by this
  for (std::size_t i = 0; i < 4; ++i)
    out.push_back(unit ? (d.quats[4 * k + i] - raw[i] * along / square) / std::sqrt(square)
                       : d.quats[4 * k + i] / 1e-12);
}

}  // namespace vsplat::ref

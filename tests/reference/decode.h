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

// Appends the Gaussian that `raw` (11 + sh_size numbers) means.
inline void decode(const float* raw, const double anchor[3], double reach, double voxel, long sh_size,
                   GaussianLists& out) {
  for (int i = 0; i < 3; ++i) out.means.push_back(anchor[i] + (2 * logistic(raw[i]) - 1) * reach);
  for (long i = 0; i < sh_size; ++i) out.sh.push_back(raw[3 + i]);
  raw += 3 + sh_size;
  out.opacities.push_back(logistic(raw[0] - 2.1792));
  for (int i = 0; i < 3; ++i) out.scales.push_back(std::log1p(std::exp(raw[1 + i] + std::log(std::expm1(voxel / 6)))));
  double norm = 0;
  for (int i = 0; i < 4; ++i) norm += static_cast<double>(raw[4 + i]) * raw[4 + i];
  norm = std::max(std::sqrt(norm), 1e-12);
  for (int i = 0; i < 4; ++i) out.quats.push_back(raw[4 + i] / norm);
}

}  // namespace vsplat::ref

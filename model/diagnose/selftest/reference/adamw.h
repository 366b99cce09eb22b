// AdamW, the clipping of gradients and a moving average in double, from their definitions.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

struct Adamw {
  double lr, beta1, beta2, eps, weight_decay;
};

// Step t, from 1, of Algorithm 2 of Loshchilov and Hutter (2019), the decay on what was there before.
inline void adamw(const Adamw& a, long t, const std::vector<double>& grad, std::vector<double>& param,
                  std::vector<double>& m, std::vector<double>& v) {
  for (std::size_t i = 0; i < param.size(); ++i) {
    param[i] *= 1 - a.lr * a.weight_decay;
    m[i] = a.beta1 * m[i] + (1 - a.beta1) * grad[i];
    v[i] = a.beta2 * v[i] + (1 - a.beta2) * grad[i] * grad[i];
    const double m_hat = m[i] / (1 - std::pow(a.beta1, static_cast<double>(t)));
    const double v_hat = v[i] / (1 - std::pow(a.beta2, static_cast<double>(t)));
    param[i] -= a.lr * m_hat / (std::sqrt(v_hat) + a.eps);
  }
}

inline double norm(const std::vector<std::vector<float>>& grads) {
  double sum = 0;
  for (const auto& grad : grads)
    for (const float g : grad) sum += static_cast<double>(g) * static_cast<double>(g);
  return std::sqrt(sum);
}

inline double clip_factor(double norm, double max_norm) { return std::min(1.0, max_norm / (norm + 1e-6)); }

}  // namespace vsplat::ref

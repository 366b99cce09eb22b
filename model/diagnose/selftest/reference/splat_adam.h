// Adam on a kind of parameter of Gaussians in double, from its definition.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

struct SplatAdam {
  double rate, rate_rest, beta1, beta2, eps, low, high;
  std::size_t width, head;  // numbers of a Gaussian; how many of them have `rate`
};

// Step t, from 1, of Algorithm 1 of Kingma and Ba (2015).
inline void splat_adam(const SplatAdam& a, long t, const std::vector<double>& grad, std::vector<double>& param,
                       std::vector<double>& m, std::vector<double>& v) {
  for (std::size_t i = 0; i < param.size(); ++i) {
    m[i] = a.beta1 * m[i] + (1 - a.beta1) * grad[i];
    v[i] = a.beta2 * v[i] + (1 - a.beta2) * grad[i] * grad[i];
    const double m_hat = m[i] / (1 - std::pow(a.beta1, static_cast<double>(t)));
    const double v_hat = v[i] / (1 - std::pow(a.beta2, static_cast<double>(t)));
    param[i] -= (i % a.width < a.head ? a.rate : a.rate_rest) * m_hat / (std::sqrt(v_hat) + a.eps);
    param[i] = std::clamp(param[i], a.low, a.high);
  }
}

}  // namespace vsplat::ref

// The derivatives of GELU (also by tanh), SiLU and ReLU in double.
#pragma once
#include <cmath>

#include "model/diagnose/selftest/reference/gemm.h"

namespace vsplat::ref {

// 1 GELU, 2 SiLU, 3 ReLU (0 at 0), 4 GELU by tanh
inline double activation_slope(double x, int act) {
  if (act == 1) return 0.5 * std::erfc(-x / std::sqrt(2.0)) + x * std::exp(-x * x / 2) / std::sqrt(2 * std::acos(-1.0));
  if (act == 3) return x > 0 ? 1 : 0;
  if (act == 4) {
    const double by = std::sqrt(2 / std::acos(-1.0)), tanh = std::tanh(by * (x + 0.044715 * x * x * x));
    return 0.5 * (1 + tanh) + 0.5 * x * (1 - tanh * tanh) * by * (1 + 3 * 0.044715 * x * x);
  }
  const double s = 1 / (1 + std::exp(-x));
  return s + x * s * (1 - s);
}

}  // namespace vsplat::ref

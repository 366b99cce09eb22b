// The derivatives of GELU and SiLU in double.
#pragma once
#include <cmath>

#include "tests/reference/gemm.h"

namespace vsplat::ref {

// 1 GELU, 2 SiLU
inline double activation_slope(double x, int act) {
  if (act == 1) return 0.5 * std::erfc(-x / std::sqrt(2.0)) + x * std::exp(-x * x / 2) / std::sqrt(2 * std::acos(-1.0));
  const double s = 1 / (1 + std::exp(-x));
  return s + x * s * (1 - s);
}

}  // namespace vsplat::ref

// A scale of a Linear's outputs, folded into its weights, in double.
#pragma once
#include <cstddef>
#include <vector>

#include "model/diagnose/selftest/reference/differences.h"

namespace vsplat::ref {

struct LayerScaleCase {
  std::vector<double> w, b, s;  // [n, k], [n], [n]

  // s w, then s b
  std::vector<double> forward() const {
    const std::size_t n = b.size(), k = w.size() / n;
    std::vector<double> out;
    for (std::size_t i = 0; i < w.size(); ++i) out.push_back(s[i / k] * w[i]);
    for (std::size_t i = 0; i < n; ++i) out.push_back(s[i] * b[i]);
    return out;
  }
  // The gradient of sum(dy forward()) by one of the three.
  std::vector<double> gradient(std::vector<double> LayerScaleCase::*by, const std::vector<float>& dy) const {
    LayerScaleCase at = *this;
    return linear_differences(at.*by, [&] { return weighed(at.forward(), dy); });
  }
};

}  // namespace vsplat::ref

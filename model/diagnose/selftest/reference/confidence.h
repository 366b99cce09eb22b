// Confidences in double, and the derivative of sum(dy x confidence) by central differences.
#pragma once
#include <cmath>
#include <vector>

#include "model/diagnose/selftest/reference/differences.h"

namespace vsplat::ref {

inline std::vector<double> confidence(const std::vector<double>& logits, bool softmax) {
  std::vector<double> out;
  out.reserve(logits.size());
  double total = 0;
  for (const double x : logits) total += std::exp(x);
  for (const double x : logits) out.push_back(softmax ? std::exp(x) / total : 1 / (1 + std::exp(-x)));
  return out;
}

// By the logits.
inline std::vector<double> confidence_backward(std::vector<double> logits, bool softmax, const std::vector<float>& x,
                                               const std::vector<float>& dy) {
  const std::size_t channels = logits.empty() ? 0 : x.size() / logits.size();
  const auto loss = [&] {
    const std::vector<double> c = confidence(logits, softmax);
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += c[i / channels] * x[i] * dy[i];
    return sum;
  };
  return central_differences(logits, 1e-5, loss);
}

}  // namespace vsplat::ref

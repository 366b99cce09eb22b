// Confidences in double, and the derivative of sum(dy x confidence) by central differences.
#pragma once
#include <cmath>
#include <vector>

namespace vsplat::ref {

inline std::vector<double> confidence(const std::vector<double>& logits, bool softmax) {
  std::vector<double> out;
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
  constexpr double step = 1e-5;
  std::vector<double> out;
  for (double& at : logits) {
    const double before = at;
    at = before + step;
    const double above = loss();
    at = before - step;
    out.push_back((above - loss()) / (2 * step));
    at = before;
  }
  return out;
}

}  // namespace vsplat::ref

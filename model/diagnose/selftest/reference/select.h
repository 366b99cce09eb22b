// The confidence's factor and what it selects, of one voxel, in double.
#pragma once
#include <string>

#include "model/diagnose/selftest/reference/decode.h"

namespace vsplat::ref {

struct Chosen {
  double factor = 1, refined = 0;
  bool flag = false;
};

inline Chosen select(const std::string& selection, double logit, double noise, double opacity, double temperature,
                     double threshold) {
  Chosen out;
  out.flag = opacity > threshold;
  if (selection == "gumbel") out.factor = logistic((logit + noise) / temperature), out.flag = out.factor > 0.5;
  if (selection == "sigmoid") out.factor = logistic(logit), out.flag = out.factor > 0.5;
  if (selection == "ste") out.flag = logistic(logit) > 0.5, out.factor = out.flag ? 1 : 0;
  out.refined = opacity * out.factor;
  return out;
}

struct SelectGradient {
  double logit = 0, opacity = 0;
};

// The gradient of a loss whose derivative by the refined opacity is d.
inline SelectGradient select_backward(const std::string& selection, double logit, double noise, double opacity,
                                      double temperature, double d) {
  const double factor = select(selection, logit, noise, opacity, temperature, 0).factor;
  SelectGradient out;
  out.opacity = d * factor;
  const auto slope = [](double x) { return logistic(x) * logistic(-x); };
  if (selection == "gumbel") out.logit = d * opacity * slope((logit + noise) / temperature) / temperature;
  if (selection == "sigmoid" || selection == "ste") out.logit = d * opacity * slope(logit);
  return out;
}

}  // namespace vsplat::ref

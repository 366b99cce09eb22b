// Children of points in double, from the definition.
#pragma once
#include <cmath>
#include <vector>

#include "model/diagnose/selftest/reference/differences.h"

namespace vsplat::ref {

struct UpscaleCase {
  std::size_t f = 1, n = 0, c = 1;  // children of a point, frequencies, channels
  double reach = 0, unit = 1;
  std::vector<double> raw, points, feature;  // [P,3F], [P,3], [P,C]

  struct Result {
    std::vector<double> children, offsets, wide;
  };
  Result forward() const {
    Result out;
    for (std::size_t child = 0; child < raw.size() / 3; ++child) {
      const std::size_t p = child / f;
      double offset[3];
      for (std::size_t a = 0; a < 3; ++a) {
        offset[a] = reach * std::tanh(raw[3 * child + a]);
        out.offsets.push_back(offset[a]);
        out.children.push_back(points[3 * p + a] + offset[a]);
      }
      for (const bool cosine : {false, true})
        for (std::size_t i = 0; i < 3 * n; ++i) {
          const std::size_t octave = i / 3;
          const double phase = std::pow(2.0, static_cast<double>(octave)) * unit * offset[i % 3];
          out.wide.push_back(cosine ? std::cos(phase) : std::sin(phase));
        }
      for (std::size_t i = 0; i < c; ++i) out.wide.push_back(feature[p * c + i]);
    }
    return out;
  }

  // The gradients of sum(dchildren children) + sum(dwide wide), by central differences.
  std::vector<double> gradient(std::vector<double> UpscaleCase::*by, const std::vector<float>& dchildren,
                               const std::vector<float>& dwide) const {
    UpscaleCase moved = *this;
    const auto loss = [&] {
      const Result out = moved.forward();
      return weighed(out.children, dchildren) + weighed(out.wide, dwide);
    };
    return central_differences(moved.*by, 1e-5, loss);
  }
};

}  // namespace vsplat::ref

// Children of points in double, from the definition.
#pragma once
#include <cmath>
#include <vector>

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
          const double phase = std::pow(2.0, static_cast<double>(i / 3)) * unit * offset[i % 3];
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
      double sum = 0;
      for (std::size_t i = 0; i < dchildren.size(); ++i) sum += dchildren[i] * out.children[i];
      for (std::size_t i = 0; i < dwide.size(); ++i) sum += dwide[i] * out.wide[i];
      return sum;
    };
    constexpr double step = 1e-5;
    std::vector<double> gradient;
    for (double& x : moved.*by) {
      const double before = x;
      x = before + step;
      const double above = loss();
      x = before - step;
      gradient.push_back((above - loss()) / (2 * step));
      x = before;
    }
    return gradient;
  }
};

}  // namespace vsplat::ref

// What the views show at points, in double, from the definition.
#pragma once
#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/project_features.h"

namespace vsplat::ref {

struct SamplePointsCase {
  long size = 0;
  std::vector<Camera> cameras;
  bool half_pixel = true;
  std::vector<double> maps;    // [V, S, S, 8]
  std::vector<double> points;  // [P, 3]

  // [V, 8] of point p
  std::vector<double> at(std::size_t p) const {
    std::vector<double> out, one;
    for (std::size_t v = 0; v < cameras.size(); ++v) {
      const double z = sample_view(maps, size, 8, static_cast<long>(v), cameras[v], static_cast<int>(size), half_pixel,
                                   {points[3 * p], points[3 * p + 1], points[3 * p + 2]}, one);
      one[7] = std::abs(one[7] - z);
      out.insert(out.end(), one.begin(), one.end());
    }
    return out;
  }
  std::vector<double> all() const {
    std::vector<double> out;
    for (std::size_t p = 0; 3 * p < points.size(); ++p) {
      const std::vector<double> one = at(p);
      out.insert(out.end(), one.begin(), one.end());
    }
    return out;
  }
  double loss(std::size_t p, const std::vector<float>& dout) const {
    const std::vector<double> y = at(p);
    double sum = 0;
    for (std::size_t i = 0; i < y.size(); ++i) sum += y[i] * static_cast<double>(dout[p * y.size() + i]);
    return sum;
  }

  // The gradients of sum(dout out) by the points and by the maps, by central differences.
  std::vector<double> points_gradient(const std::vector<float>& dout) const {
    constexpr double step = 1e-7;
    SamplePointsCase moved = *this;
    std::vector<double> gradient;
    for (std::size_t i = 0; i < points.size(); ++i) {
      moved.points[i] = points[i] + step;
      const double more = moved.loss(i / 3, dout);
      moved.points[i] = points[i] - step;
      gradient.push_back((more - moved.loss(i / 3, dout)) / (2 * step));
      moved.points[i] = points[i];
    }
    return gradient;
  }
  std::vector<double> maps_gradient(const std::vector<float>& dout) const {
    SamplePointsCase moved = *this;
    const auto loss_of_all = [&] {
      double sum = 0;
      for (std::size_t p = 0; 3 * p < points.size(); ++p) sum += moved.loss(p, dout);
      return sum;
    };
    return central_differences(moved.maps, 1e-6, loss_of_all);
  }
};

}  // namespace vsplat::ref

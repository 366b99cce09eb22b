// Derivatives by differences, in double.
#pragma once
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// The derivative of f, by central differences of `step` and of half of it, whose leading errors cancel; f(0) is not
// evaluated.
template <class F>
double derivative_at_0(double step, const F& f) {
  const auto slope = [&](double h) { return (f(h) - f(-h)) / (2 * h); };
  return (4 * slope(step / 2) - slope(step)) / 3;
}

// The derivative of loss() by `value`, which is moved and put back.
template <class Loss>
double derivative_by(double& value, double step, const Loss& loss) {
  const double base = value;
  const double out = derivative_at_0(step, [&](double h) {
    value = base + h;
    return loss();
  });
  value = base;
  return out;
}

// The same by a float: each step is the one between the floats that it is rounded to.
template <class Loss>
double derivative_by(float& value, double step, const Loss& loss) {
  const float base = value;
  const auto slope = [&](double h) {
    const float low = base - static_cast<float>(h), high = base + static_cast<float>(h);
    value = high;
    const double above = loss();
    value = low;
    const double below = loss();
    return (above - below) / (static_cast<double>(high) - low);
  };
  const double out = (4 * slope(step / 2) - slope(step)) / 3;
  value = base;
  return out;
}

// The derivatives of loss() by each of `values`, by two points at a distance of `step`.
template <class Loss>
std::vector<double> central_differences(std::vector<double>& values, double step, const Loss& loss) {
  std::vector<double> out;
  for (double& value : values) {
    const double base = value;
    value = base + step;
    const double above = loss();
    value = base - step;
    out.push_back((above - loss()) / (2 * step));
    value = base;
  }
  return out;
}

// The same where the loss is linear in each of the values alone, so that any two points do.
template <class Number, class Loss>
std::vector<double> linear_differences(std::vector<Number>& values, const Loss& loss) {
  std::vector<double> out;
  for (Number& value : values) {
    const Number base = value;
    value = 1;
    const double above = loss();
    value = -1;
    out.push_back((above - loss()) / 2);
    value = base;
  }
  return out;
}

// What a loss with these derivatives says of a map; 0 where there are none.
template <class Number>
double weighed(const std::vector<double>& map, const std::vector<Number>& by) {
  double sum = 0;
  for (std::size_t i = 0; i < by.size(); ++i) sum += map[i] * by[i];
  return sum;
}

}  // namespace vsplat::ref

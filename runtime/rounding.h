// Rounds up to whole steps.
#pragma once

namespace vsplat {

// The number of steps of size `step` that cover n. Both are at least 0, and step is not 0.
template <class T>
constexpr T div_up(T n, T step) {
  return (n + step - 1) / step;
}

// The smallest multiple of `step` that is at least n.
template <class T>
constexpr T round_up(T n, T step) {
  return div_up(n, step) * step;
}

}  // namespace vsplat

// Rotary position embedding in double, as a product of complex numbers.
#pragma once
#include <cmath>
#include <complex>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// The angles of an h x w grid for heads of d: [h w, d/2].
inline std::vector<double> rope_angles(std::size_t h, std::size_t w, std::size_t d, double base) {
  std::vector<double> out;
  for (std::size_t token = 0; token < h * w; ++token)
    for (std::size_t j = 0; j < d / 2; ++j) {
      const bool of_row = j < d / 4;
      const double place = of_row ? (static_cast<double>(token / w) + 0.5) / static_cast<double>(h)
                                  : (static_cast<double>(token % w) + 0.5) / static_cast<double>(w);
      const double period = std::pow(base, 4.0 * static_cast<double>(j % (d / 4)) / static_cast<double>(d));
      out.push_back(2 * std::acos(-1.0) * (2 * place - 1) / period);
    }
  return out;
}

// qkv [v, t, 3, h, d] with q and k of the last tokens, as many as there are angles for, turned; `sign` -1: back.
template <class F>
std::vector<double> rope(const std::vector<F>& qkv, std::size_t v, std::size_t t, std::size_t h, std::size_t d,
                         const std::vector<double>& angles, double sign) {
  std::vector<double> out(qkv.begin(), qkv.end());
  const std::size_t turned = angles.size() / (d / 2);
  for (std::size_t view = 0; view < v; ++view)
    for (std::size_t token = t - turned; token < t; ++token)
      for (std::size_t head = 0; head < 2 * h; ++head)  // the queries', then the keys'
        for (std::size_t j = 0; j < d / 2; ++j) {
          const std::size_t at = ((view * t + token) * 3 * h + head) * d + j;
          const std::complex<double> z = std::complex<double>(out[at], out[at + d / 2]) *
                                         std::polar(1.0, sign * angles[(token - (t - turned)) * (d / 2) + j]);
          out[at] = z.real();
          out[at + d / 2] = z.imag();
        }
  return out;
}

}  // namespace vsplat::ref

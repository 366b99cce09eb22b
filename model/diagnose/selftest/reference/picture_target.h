// What a drawn pixel should have been, in double.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace vsplat::ref {

struct PixelTarget {
  std::array<double, 3> colour;
  double dalpha;
};

// `given`: premultiplied colour and alpha; `slope`: what the loss gains by alpha being off by 1.
inline PixelTarget pixel_target(const std::uint8_t* given, bool known, const std::array<double, 3>& background,
                                const std::array<double, 3>& drawn, double alpha, double slope) {
  PixelTarget out{};
  for (std::size_t c = 0; c < 3; ++c)
    out.colour[c] = known ? (given[c] + (255 - given[3]) * background[c]) / 255 : std::clamp(drawn[c], 0.0, 1.0);
  const double steps = 255 * alpha - given[3];  // of 8 bits
  if (known && std::abs(steps) > 0.5) out.dalpha = steps > 0 ? slope : -slope;
  return out;
}

}  // namespace vsplat::ref

// What a fit is given of a picture, and what it draws: random.
#pragma once
#include <cmath>
#include <cstdint>
#include <vector>

#include "model/diagnose/selftest/inputs/random_values.h"

namespace vsplat::selftest {

struct GivenPicture {
  std::vector<std::uint8_t> given, known;
  std::vector<float> colour, alpha;
};

// Colours beyond [0, 1], too; alphas that differ from what is given by all kinds of amounts, none near half a step.
inline GivenPicture given_picture(long h, long w) {
  GivenPicture out;
  const auto random = random_floats(8 * size_of(h, w), static_cast<std::uint32_t>(97 * h + w), 0, 1);
  for (std::size_t i = 0; i < size_of(h, w); ++i) {
    const float* r = &random[8 * i];
    const int a = i % 3 == 0 ? 255 : i % 3 == 1 ? static_cast<int>(255 * r[0]) : 0;
    for (int k = 1; k < 4; ++k) out.given.push_back(static_cast<std::uint8_t>(static_cast<float>(a) * r[k]));
    out.given.push_back(static_cast<std::uint8_t>(a));
    out.known.push_back(i > 0 && r[4] < 0.3f ? 0 : r[4] < 0.6f ? 1 : 255);
    for (int k = 1; k < 4; ++k) out.colour.push_back(2 * r[k + 3] - 0.5f);
    float off = (r[0] - 0.5f) * (i % 2 == 0 ? 3.0f : 200.0f);
    if (std::abs(std::abs(off) - 0.5f) < 1e-2f) off += 0.1f;
    out.alpha.push_back((static_cast<float>(a) + off) / 255);
  }
  return out;
}

}  // namespace vsplat::selftest

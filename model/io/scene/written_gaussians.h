// What the writers of lossy formats share.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "model/base/gaussians.h"

namespace vsplat {

// Formats of volumes alone get surfels as volumes with this share of the smaller scale as the third one.
inline constexpr double kWrittenThickness = 0.01;

// The Gaussians as volumes; `made` holds them if they were surfels. Error(input), naming the Gaussian and the field, if
// a value is not finite, a scale is negative or there are no Gaussians.
const Gaussians& volumes_to_write(const std::string& path, const Gaussians& given, Gaussians& made);

// The nearest of 0 to 255.
inline std::uint8_t to_byte(double value) {
  // lround would take several times as long; the value is not negative.
  return static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0) + 0.5);  // NOLINT(bugprone-incorrect-roundings)
}

// A quaternion w x y z of length 1; 1 0 0 0 for one of length 0.
struct UnitQuaternion {
  explicit UnitQuaternion(const float* from);
  double at[4];
};

}  // namespace vsplat

// The packed values of SPZ, for its reader and its writer.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace vsplat {

inline constexpr double kSpzColorScale = 0.15;    // a colour's byte is (f_dc scale + 0.5) 255
inline constexpr double kSpzLeastLogScale = -10;  // a scale's byte is 16 (logarithm + 10)
inline constexpr double kSpzLogScaleSteps = 16;
inline constexpr double kSpzShSteps = 128;     // a coefficient's byte is 128 (value + 1)
inline constexpr int kSpzRotationSteps = 511;  // for 1 / sqrt 2, of the smallest three parts

// The signs that take values from one frame to another whose axes are the same but for their directions.
struct SpzFlips {
  Eigen::Array3f position;  // x y z
  Eigen::Array4f rotation;  // w x y z
  std::vector<float> sh;    // of each coefficient from degree 1 on
};
// From the storage frame (SpzContainer::frame) to that of a PLY, and back: the signs are their own inverse.
SpzFlips spz_flips(std::uint32_t frame, int degree);

}  // namespace vsplat

// What a scene's Gaussians are like, in numbers.
#pragma once
#include <Eigen/Core>
#include <cstdint>

#include "model/base/scene.h"

namespace vsplat {

struct SceneStatistics {
  std::uint64_t not_finite = 0;   // Gaussians with a NaN or an infinity; they count in nothing below
  std::uint64_t transparent = 0;  // opacity below 0.1
  std::uint64_t invisible = 0;    // opacity below 1/255: no picture shows them
  // Largest standard deviation above a tenth of the diagonal of the box from `low_1` to `high_99`.
  std::uint64_t huge = 0;
  // More than ten times as far from the middle, the median of the means along each axis, as the median Gaussian.
  std::uint64_t distant = 0;
  // Bounds of the means in the world, and their 1st and 99th percentiles along each axis; 0 without Gaussians.
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = low, low_1 = low, high_99 = low;
  double median_opacity = 0;
  double median_size = 0, largest_size = 0;  // of the Gaussians' largest standard deviations
};
SceneStatistics statistics_of(const Scene& scene);

}  // namespace vsplat

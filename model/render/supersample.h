// Supersampling for pictures smaller than those that a scene was made from. A Gaussian covers at least about a pixel
// (0.3 is added to its covariance in the picture), and a network learns Gaussians that look right at its own
// resolution; in smaller pictures each one is too wide. Drawing at the original resolution and averaging preserves the
// appearance.
#pragma once
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/base/scene.h"

namespace vsplat {

inline constexpr int kMostSamples = 8;        // along a pixel's edge
inline constexpr int kLargestSampled = 2048;  // pixels along an edge; larger pictures get fewer samples

// The same view at k times the width and height.
Camera times_as_large(const Camera& camera, int k);

// The median over the cameras of a pixel's width at `at`; nothing if it is in front of no camera.
std::optional<Detail> detail_of(const std::vector<Camera>& cameras, const Eigen::Vector3d& at);

// The number of samples along a pixel's edge that gives pixels at least as wide as the detail's, 1 to kMostSamples. The
// camera is in the detail's frame.
int samples_for(const Detail& detail, const Camera& camera);

}  // namespace vsplat

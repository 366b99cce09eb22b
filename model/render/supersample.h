// Pictures smaller than those that a scene was made from. A Gaussian covers at least about a pixel (0.3 is added to its
// covariance in the picture), and a network learns Gaussians that look right so in pictures of its own size: in smaller
// ones each is too wide. Drawn in the size that they were made for, and averaged, they look as they do there.
#pragma once
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/base/scene.h"

namespace vsplat {

inline constexpr int kMostSamples = 8;        // along a pixel's edge
inline constexpr int kLargestSampled = 2048;  // pixels along an edge; what would be drawn larger has fewer samples

// The same view in k times the width and height.
Camera times_as_large(const Camera& camera, int k);

// The median over the cameras of how wide a pixel is at that place; none where it lies before no camera.
std::optional<Detail> detail_of(const std::vector<Camera>& cameras, const Eigen::Vector3d& at);

// How many samples along a pixel's edge make pixels of that detail or wider ones, 1 to kMostSamples. The camera is in
// the detail's frame.
int samples_for(const Detail& detail, const Camera& camera);

}  // namespace vsplat

// Locates the object from a scene's sparse points.
#pragma once
#include <optional>
#include <span>

#include "model/base/camera.h"
#include "model/io/views/colmap_points.h"
#include "model/views/placement.h"

namespace vsplat {

struct PointCube {
  Placement placement;
  std::size_t points = 0;  // number of points used
};

// The cube of the densest points that most cameras see. It contains all but two in a thousand of them, aligned with the
// world's axes or with those of any camera. Excluded are points seen in fewer than three pictures or measured badly,
// points outside the pictures of more than half of the cameras, points whose neighbours are three times as far away as
// usual, and points farther from the others than a picture covers at their distance. Each of the first two rules is
// dropped if it would leave less than a tenth. `centre` may be given. Intrinsics must be known. Nothing if fewer than
// 30 points are left.
std::optional<PointCube> cube_of_points(std::span<const Camera> cameras, std::span<const ColoredPoint> points,
                                        const std::optional<Eigen::Vector3d>& centre = {});

}  // namespace vsplat

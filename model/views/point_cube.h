// Finding the object from a scene's sparse points.
#pragma once
#include <optional>
#include <span>

#include "model/base/camera.h"
#include "model/io/views/colmap_points.h"
#include "model/views/placement.h"

namespace vsplat {

struct PointCube {
  Placement placement;
  std::size_t points = 0;  // that it is made from
};

// The cube of the densest points that most cameras see: it holds all but two in a thousand of them, whether it lies
// along the world's axes or along those of any camera. Left out are points that fewer than three pictures show or that
// were measured badly, points outside the picture of more than half of the cameras, points whose neighbours are three
// times as far as usual, and points farther from the others than a picture shows at their distance. Each of the first
// two rules is dropped where it would leave less than a tenth. `centre`: settled already. Intrinsics must be known.
// Nothing where fewer than 30 points are left.
std::optional<PointCube> cube_of_points(std::span<const Camera> cameras, std::span<const ColoredPoint> points,
                                        const std::optional<Eigen::Vector3d>& centre = {});

}  // namespace vsplat

// The frame in which a whole scene is fitted, as opposed to an object's cube.
#pragma once
#include <span>
#include <string>

#include "model/views/placement.h"
#include "model/views/seen_points.h"

namespace vsplat {

struct SceneFrame {
  // The centre is the mean of the cameras. The edge is the unit of length: 1.1 times the largest distance of a camera
  // from the median of the cameras, but at most 3.3 times the median distance, so that a stray camera has no influence.
  Placement placement;
  double near = 0;    // near plane: a hundredth of the distance to the nearest seen point, or of the unit, world units
  std::string found;  // a sentence with the figures
};

// `cameras`: at least one, with known intrinsics. `points`: in the cameras' world; may be empty. If all cameras are at
// one place, the unit is the median distance to the points; Error(input) without points.
SceneFrame scene_frame(std::span<const Camera> cameras, std::span<const ColoredPoint> points);

// Returns the text of a warning if `near` cuts away points that cameras see, else "".
std::string cut_by_near(std::span<const Camera> cameras, std::span<const ColoredPoint> points, double near);

}  // namespace vsplat

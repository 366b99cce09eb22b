// Refuses implausible poses before anything is computed from them.
#pragma once
#include <optional>
#include <span>

#include "model/io/views/view_set.h"
#include "model/views/placement.h"

namespace vsplat {

// The position of a world point in the (distorted) picture, in pixels; nothing if it is not in front of the camera or
// the lens does not show it.
std::optional<Eigen::Vector2d> project_to_picture(const Camera& camera, const Eigen::Vector3d& point);

// Cameras are in the user's world, with known intrinsics. Error(input) if the cube's centre is behind more than half of
// them or outside their pictures. The error names the swap of conventions, if there is one, that would bring the centre
// into all pictures. If fewer cameras miss it, or with `force`, this is only a warning; leave `force` empty if the user
// has no such option. A centre that was estimated from the cameras moves with a swap, to the point where the swapped
// axes meet; if a swap makes the axes of at least three cameras meet far better, a warning names it.
void check_centre_is_seen(std::span<const Camera> cameras, PoseConvention convention, const ChosenPlacement& chosen,
                          std::optional<bool> force = {});

// Names the swaps of conventions after which all cameras look at one point in front of them, and says what to do. ""
// if there is no such swap, or if they look at one point as they are.
std::string poses_that_meet(std::span<const Camera> cameras, PoseConvention convention);

// Logs a warning if several cameras are all at one place, since distances cannot be known then, and if principal points
// lie outside their pictures. `set` begins the message.
void warn_of_unlikely_cameras(const std::string& set, std::span<const Camera> cameras);

// Cameras in the object's frame. Error(input) if a corner of the cube [-0.5,0.5]^3 is not in front of every camera.
void check_cube_is_in_front(std::span<const Camera> cameras, const Placement& placement);

}  // namespace vsplat

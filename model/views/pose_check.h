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

// Cameras in the user's world, intrinsics known. Error(input) where the cube's centre is behind, or outside the picture
// of, more than half of them; it names the swap of conventions that would put it in all their pictures, if one does.
// `force`: a warning instead, as for fewer of them; without a value the caller's own caller has no such choice. A
// centre that was estimated from the cameras moves with a swap: then it is where the swapped axes meet, and a warning
// names a swap after which the axes of three cameras or more meet far better.
void check_centre_is_seen(std::span<const Camera> cameras, PoseConvention convention, const ChosenPlacement& chosen,
                          std::optional<bool> force = {});

// A sentence that names the swaps of conventions after which all cameras look at one point before them, with what to
// do; "" where there is none, or where they look at one as they are.
std::string poses_that_meet(std::span<const Camera> cameras, PoseConvention convention);

// A warning where all of several cameras are at one place: nothing tells how far away anything is then. `set`: what it
// begins with.
void warn_of_one_place(const std::string& set, std::span<const Camera> cameras);

// Cameras in the object's frame. Error(input) if a corner of the cube [-0.5,0.5]^3 is not in front of every camera.
void check_cube_is_in_front(std::span<const Camera> cameras, const Placement& placement);

}  // namespace vsplat

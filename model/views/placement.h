// The object's placement: the cube in the user's world that is mapped to [-0.5,0.5]^3, and the network's frame.
#pragma once
#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/scene.h"

namespace vsplat {

// The object's cube, in world units.
struct Placement {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double edge = 1;
};

// The camera in the frame that `frame_to_world` maps from; its pose is rigid again.
Camera to_frame(const Camera& camera, const Similarity& frame_to_world);

struct PlacedViews {
  std::vector<Camera> cameras;  // in the object's frame and units
  Similarity to_world;          // from the object's frame to the user's world
};

// `place` and `rebase` of the reference implementation: shifts and scales the world by the cube, then rotates it so
// that the first view has identity rotation. "rotate" rotates about the cube's centre; "move" also puts the first
// camera at (0,0,-r), r being its distance from the centre. At least one camera; Error(usage) for another mode.
PlacedViews place_views(std::span<const Camera> cameras, const Placement& placement, const std::string& rebase);

// The sources of the cube, for centre and edge independently: the request, else the values listed in the file, else the
// estimate.
struct PlacementRequest {
  std::optional<Eigen::Vector3d> centre;
  std::optional<double> edge;
  bool auto_frame = false;  // estimate even if the file lists the cube
};
struct ChosenPlacement {
  Placement placement;
  std::string found;  // a sentence: the figures and where they come from
  // The centre was estimated from the cameras and their masks: with other poses it would be elsewhere.
  bool moves_with_poses = false;
  std::string centre_from = {};  // "estimated", "from aabb_center"; "": not known
};
struct EstimatedPlacement {
  Placement placement;
  std::string from;  // what it was estimated from
  bool moves_with_poses = true;
};
// Calls `estimate`, with the centre if that is already known, only if a value is still unknown.
ChosenPlacement choose_placement(
    const PlacementRequest& request, const std::optional<Eigen::Vector3d>& listed_centre,
    const std::optional<double>& listed_half,
    const std::function<EstimatedPlacement(const std::optional<Eigen::Vector3d>& centre)>& estimate);

// "(x, y, z)" with six digits, or twelve if far from the origin, for messages.
std::string to_text(const Eigen::Vector3d& v);

}  // namespace vsplat

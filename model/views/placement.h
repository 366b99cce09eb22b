// Where the object is: the cube in the user's world that becomes [-0.5,0.5]^3, and the frame the network works in.
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

// The object's cube, in the units of the user's world.
struct Placement {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double edge = 1;
};

// The camera, rigid again, in the frame that `frame_to_world` leads out of.
Camera to_frame(const Camera& camera, const Similarity& frame_to_world);

struct PlacedViews {
  std::vector<Camera> cameras;  // in the object's frame, in its units
  Similarity to_world;          // from the object's frame to the user's world
};

// `place` and `rebase` of the reference: the world shifted and scaled by the cube, then turned so that the first view
// has identity rotation. "rotate" turns about the cube's centre; "move" also puts the first camera at (0,0,-r), r its
// distance from the centre. At least one camera; Error(usage) for another mode.
PlacedViews place_views(std::span<const Camera> cameras, const Placement& placement, const std::string& rebase);

// Where the cube comes from, centre and edge each by itself: what was asked for, else what the file lists, else the
// estimate.
struct PlacementRequest {
  std::optional<Eigen::Vector3d> centre;
  std::optional<double> edge;
  bool auto_frame = false;  // what the file lists is estimated, too
};
struct ChosenPlacement {
  Placement placement;
  std::string found;  // a sentence: the figures and where they come from
  // The centre was estimated from the cameras and their masks: with other poses it would be elsewhere.
  bool moves_with_poses = false;
};
struct EstimatedPlacement {
  Placement placement;
  std::string from;  // what it was estimated from
  bool moves_with_poses = true;
};
// `estimate` is called, with the centre that is already settled if one is, where something is left to it.
ChosenPlacement choose_placement(
    const PlacementRequest& request, const std::optional<Eigen::Vector3d>& listed_centre,
    const std::optional<double>& listed_half,
    const std::function<EstimatedPlacement(const std::optional<Eigen::Vector3d>& centre)>& estimate);

// "(x, y, z)" with six digits, for messages.
std::string to_text(const Eigen::Vector3d& v);

}  // namespace vsplat

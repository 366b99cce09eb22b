#include "model/views/placement.h"

#include <fmt/format.h>

#include <cmath>

#include "runtime/fail.h"

namespace vsplat {

Camera to_frame(const Camera& camera, const Similarity& frame_to_world) {
  Camera out = camera;
  const Eigen::Matrix3d R = camera.w2c.topLeftCorner<3, 3>();
  out.w2c.topLeftCorner<3, 3>() = R * frame_to_world.rotation;
  out.w2c.topRightCorner<3, 1>() = R * (frame_to_world.translation - camera.centre()) / frame_to_world.scale;
  return out;
}

PlacedViews place_views(std::span<const Camera> cameras, const Placement& placement, const std::string& rebase) {
  if (cameras.empty()) fail(Status::usage, "no camera to place");
  if (rebase != "rotate" && rebase != "move") fail(Status::usage, "rebase is {}, rotate or move is expected", rebase);
  PlacedViews out;
  out.to_world.scale = placement.edge;
  out.to_world.rotation = cameras[0].w2c.topLeftCorner<3, 3>().transpose();
  out.to_world.translation = placement.centre;
  if (rebase == "move") {
    const Eigen::Vector3d first = cameras[0].centre();
    const double r = (first - placement.centre).norm();
    out.to_world.translation = first + out.to_world.rotation * Eigen::Vector3d(0, 0, r);
  }
  out.cameras.reserve(cameras.size());
  for (const Camera& camera : cameras) out.cameras.push_back(to_frame(camera, out.to_world));
  return out;
}

ChosenPlacement choose_placement(
    const PlacementRequest& request, const std::optional<Eigen::Vector3d>& listed_centre,
    const std::optional<double>& listed_half,
    const std::function<EstimatedPlacement(const std::optional<Eigen::Vector3d>& centre)>& estimate) {
  if (request.centre && !request.centre->allFinite())
    fail(Status::usage, "the object's centre is {}, finite numbers are expected", to_text(*request.centre));
  if (request.edge && !(*request.edge > 0 && std::isfinite(*request.edge)))
    fail(Status::usage, "the edge of the object's cube is {}, a positive number is expected", *request.edge);
  std::optional<Eigen::Vector3d> centre = request.centre;
  std::optional<double> edge = request.edge;
  std::string centre_from = "as asked for", edge_from = "as asked for", details;
  bool moves = false;
  if (!centre && listed_centre && !request.auto_frame) centre = listed_centre, centre_from = "from aabb_center";
  if (!edge && listed_half && !request.auto_frame) edge = 2 * *listed_half, edge_from = "from aabb_half";
  if (!centre || !edge) {
    const EstimatedPlacement found = estimate(centre);
    if (!centre) {
      centre = found.placement.centre, centre_from = "estimated";
      moves = found.moves_with_poses;
    }
    if (!edge) edge = found.placement.edge, edge_from = "estimated";
    details = "; " + found.from;
  }
  ChosenPlacement out{{*centre, *edge}, "", moves, centre_from};
  out.found = fmt::format("the object's cube: centre {} ({}), edge {:.6g} ({}){}", to_text(out.placement.centre),
                          centre_from, out.placement.edge, edge_from, details);
  return out;
}

std::string to_text(const Eigen::Vector3d& v) {
  const int digits = v.cwiseAbs().maxCoeff() < 1e5 ? 6 : 12;  // far from the origin, six digits are not enough
  return fmt::format("({:.{}g}, {:.{}g}, {:.{}g})", v.x(), digits, v.y(), digits, v.z(), digits);
}

}  // namespace vsplat

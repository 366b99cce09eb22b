#include "model/views/input.h"

#include <fmt/format.h>

#include "model/base/resample.h"
#include "model/views/auto_frame.h"
#include "model/views/listed_points.h"
#include "model/views/pose_check.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

// The data of a view that the placement is estimated from.
struct Seen {
  Camera camera;
  std::optional<MaskExtent> extent;
};

Seen see(LoadedPhotograph& view) { return {view.listed().camera, view.extent()}; }

// The points that belong to the list, if they are known to be in its world. Damaged points cause a warning.
std::vector<ColoredPoint> points_for(const Photographs& photographs) {
  if (photographs.picture) return {};  // pictures made in memory have no file of points
  try {
    std::optional<ListedPoints> found = listed_points(photographs.set);
    if (found && found->placed) return std::move(found->points);
  } catch (const Error& e) {
    warn("{}; the object's cube is estimated without points", e.what());
  }
  return {};
}

// Fallback for lists that do not describe the object and give no way to estimate it, such as a single view: many show
// objects placed at the origin. If a view does not show the origin, the original error is thrown.
EstimatedPlacement cube_at_origin(std::span<const Camera> cameras, const Error& error) {
  for (const Camera& c : cameras) {
    const auto at = project_to_picture(c, Eigen::Vector3d::Zero());
    if (!at || at->x() < 0 || at->y() < 0 || at->x() > c.width || at->y() > c.height) throw error;
  }
  return {{Eigen::Vector3d::Zero(), 1},
          fmt::format("by default, since all views show the origin: {}", error.what()),
          false};
}

// `look` is called once for each of `views` views, and only if something must be estimated.
ChosenPlacement place(const Photographs& photographs, const PlacementRequest& request, std::size_t views,
                      const std::vector<ColoredPoint>* points, const std::function<Seen(std::size_t)>& look) {
  const auto estimate = [&](const std::optional<Eigen::Vector3d>& centre) {
    std::vector<Camera> cameras;
    std::vector<std::optional<MaskExtent>> extents;
    for (std::size_t i = 0; i < views; ++i) {
      Seen seen = look(i);
      cameras.push_back(std::move(seen.camera));
      extents.push_back(seen.extent);
    }
    try {
      return auto_frame(cameras, extents, centre, points ? *points : points_for(photographs));
    } catch (const Error& e) {
      if (e.status() != Status::input) throw;
      if (const std::string meant = poses_that_meet(cameras, photographs.set.convention); !meant.empty())
        fail(Status::input, "{}; {}", e.what(), meant);
      if (centre || request.auto_frame) throw;
      return cube_at_origin(cameras, e);
    }
  };
  return choose_placement(request, photographs.set.aabb_center, photographs.set.aabb_half, estimate);
}

}  // namespace

ChosenPlacement find_placement(const Photographs& photographs, std::span<const int> views,
                               const PlacementRequest& request, const std::vector<ColoredPoint>* points) {
  return place(photographs, request, views.size(), points, [&](std::size_t i) {
    LoadedPhotograph view(photographs, views[i]);
    return see(view);
  });
}

std::vector<Camera> cameras_of(const Input& input) {
  std::vector<Camera> out;
  out.reserve(input.views.size());
  for (const PreparedView& view : input.views) out.push_back(view.camera);
  return out;
}

Input prepare_input(const Photographs& photographs, const TakenViews& taken, const InputRequest& request) {
  std::vector<std::optional<LoadedPhotograph>> loaded;
  std::vector<Camera> cameras;
  std::string names;
  const bool asked = request.view_count != 0;
  const ViewRequest wanted{request.names, asked ? request.view_count : taken.usual,
                           asked ? request.view_count : taken.trained};
  const std::vector<int> chosen_views = choose_views(photographs.set, wanted);
  if (static_cast<int>(chosen_views.size()) > taken.most)
    fail(Status::usage, "{} views are asked for, and this network takes 1 to {} (view_slots)", chosen_views.size(),
         taken.most);
  for (const int view : chosen_views) {
    const ListedView& listed = loaded.emplace_back(std::in_place, photographs, view)->listed();
    names += (names.empty() ? "" : ", ") + listed.name;
    cameras.push_back(listed.camera);
  }
  info("views: {}", names);
  const std::string set = photographs.set.source.string();
  warn_of_unlikely_cameras(set, cameras);
  std::vector<MaskShares> masks;
  for (std::optional<LoadedPhotograph>& view : loaded)
    if (const std::optional<MaskShares> shares = view->shares()) masks.push_back(*shares);
  check_masks(set, masks, loaded.size());

  Input out;
  const ChosenPlacement chosen =
      place(photographs, request.placement, loaded.size(), nullptr, [&](std::size_t i) { return see(*loaded[i]); });
  out.placement = chosen.placement;
  info("{}", chosen.found);
  check_centre_is_seen(cameras, photographs.set.convention, chosen, request.force);
  check_cube_is_in_front(place_views(cameras, out.placement, taken.rebase).cameras, out.placement);
  const Framing framing{taken.image, request.crop, out.placement.centre, out.placement.edge};
  out.masked = true;
  for (std::optional<LoadedPhotograph>& view : loaded) {
    const bool masked = view->is_masked();
    out.masked &= masked;
    out.views.push_back(on_white(view->framed(framing), masked));
    view.reset();  // decoded pictures are large
  }
  return out;
}

}  // namespace vsplat

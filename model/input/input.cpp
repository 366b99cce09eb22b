#include "model/input/input.h"

#include "model/base/resample.h"
#include "model/input/auto_frame.h"
#include "model/input/pose_check.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

// What the object's place is estimated from.
struct Seen {
  Camera camera;
  std::optional<MaskExtent> extent;
};

Seen see(LoadedPhotograph& view) { return {view.listed().camera, view.extent()}; }

// `look` is called once for each of `views` views, and only where there is something to estimate.
ChosenPlacement place(const ViewSet& set, const PlacementRequest& request, std::size_t views,
                      const std::function<Seen(std::size_t)>& look) {
  const auto estimate = [&](const std::optional<Eigen::Vector3d>& centre) {
    std::vector<Camera> cameras;
    std::vector<std::optional<MaskExtent>> extents;
    for (std::size_t i = 0; i < views; ++i) {
      Seen seen = look(i);
      cameras.push_back(std::move(seen.camera));
      extents.push_back(seen.extent);
    }
    return auto_frame(cameras, extents, centre);
  };
  return choose_placement(request, set.aabb_center, set.aabb_half, estimate);
}

}  // namespace

ChosenPlacement find_placement(const Photographs& photographs, std::span<const int> views,
                               const PlacementRequest& request) {
  return place(photographs.set, request, views.size(), [&](std::size_t i) {
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

  Input out;
  const ChosenPlacement chosen =
      place(photographs.set, request.placement, loaded.size(), [&](std::size_t i) { return see(*loaded[i]); });
  out.placement = chosen.placement;
  info("{}", chosen.found);
  check_centre_is_seen(cameras, photographs.set.convention, out.placement, request.force);
  check_cube_is_in_front(place_views(cameras, out.placement, taken.rebase).cameras, out.placement);
  const Framing framing{taken.image, request.fit, out.placement.centre, out.placement.edge};
  out.masked = true;
  for (std::optional<LoadedPhotograph>& view : loaded) {
    out.masked &= view->is_masked();
    FramedView framed = view->framed(framing);
    view.reset();  // decoded pictures are large
    out.views.push_back({on_white(framed.image), std::move(framed.camera)});
  }
  return out;
}

}  // namespace vsplat

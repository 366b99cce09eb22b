#include "model/input/input.h"

#include "model/base/resample.h"
#include "model/input/auto_frame.h"
#include "model/input/pose_check.h"
#include "model/io/image_file.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

std::optional<MaskExtent> extent_of(const Photographs& photographs, int index) {
  const ListedView& view = photographs.set.views[index];
  if (view.mask) return mask_extent(read_mask(view.mask->string()));
  const Image picture = photographs.picture ? photographs.picture(index) : read_image(view.picture.string());
  if (picture.channels != 4) return std::nullopt;
  return mask_extent(picture);
}

}  // namespace

ListedView resolved_view(const Photographs& photographs, int index) {
  ListedView view = photographs.set.views[index];
  if (photographs.picture) {
    if (is_resolved(view)) return view;  // its picture's size is looked at where it is made
    const Image picture = photographs.picture(index);
    resolve_intrinsics(view, picture.width, picture.height);
    return view;
  }
  const ImageInfo size = read_image_info(view.picture.string());
  resolve_intrinsics(view, size.width, size.height);
  return view;
}

ChosenPlacement find_placement(const Photographs& photographs, std::span<const int> views,
                               const PlacementRequest& request) {
  const auto estimate = [&](const std::optional<Eigen::Vector3d>& centre) {
    std::vector<Camera> cameras;
    std::vector<std::optional<MaskExtent>> extents;
    for (const int view : views) {
      cameras.push_back(resolved_view(photographs, view).camera);
      extents.push_back(extent_of(photographs, view));
    }
    return auto_frame(cameras, extents, centre);
  };
  const ViewSet& set = photographs.set;
  return choose_placement(request, set.aabb_center, set.aabb_half, estimate);
}

FramedView framed_view(const Photographs& photographs, int index, const Framing& framing) {
  const ListedView view = resolved_view(photographs, index);
  const std::string mask_path = view.mask ? view.mask->string() : "";
  if (!photographs.picture) return frame_view(view.camera, view.picture.string(), mask_path, framing);
  const Image mask = view.mask ? read_mask(mask_path) : Image();
  return frame_view(view.camera, photographs.picture(index), view.mask ? &mask : nullptr, framing);
}

std::vector<Camera> cameras_of(const Input& input) {
  std::vector<Camera> out;
  out.reserve(input.views.size());
  for (const PreparedView& view : input.views) out.push_back(view.camera);
  return out;
}

Input prepare_input(const Photographs& photographs, const Config& config, const InputRequest& request) {
  const std::vector<int> views = choose_views(photographs.set, {request.names, config.views});
  std::vector<Camera> cameras;
  std::string names;
  for (const int view : views) {
    const ListedView listed = resolved_view(photographs, view);
    names += (names.empty() ? "" : ", ") + listed.name;
    cameras.push_back(listed.camera);
  }
  info("views: {}", names);

  Input out;
  const ChosenPlacement place = find_placement(photographs, views, request.placement);
  out.placement = place.placement;
  info("{}", place.found);
  check_centre_is_seen(cameras, photographs.set.convention, out.placement, request.force);
  check_cube_is_in_front(place_views(cameras, out.placement, config.rebase).cameras, out.placement);
  const Framing framing{config.image, request.fit, out.placement.centre, out.placement.edge};
  for (const int view : views) {
    FramedView framed = framed_view(photographs, view, framing);
    out.views.push_back({on_white(framed.image), std::move(framed.camera)});
  }
  return out;
}

}  // namespace vsplat

#include "model/input.h"

#include "model/auto_frame.h"
#include "model/io/image_file.h"
#include "model/pose_check.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

struct Chosen {
  ListedView view;       // intrinsics known
  const Image* picture;  // null: in the view's file
};

std::vector<Chosen> choose(const Photographs& photographs, const std::vector<int>& indices) {
  std::vector<Chosen> out;
  std::string names;
  for (const int index : indices) {
    const auto i = static_cast<std::size_t>(index);
    Chosen chosen{photographs.set.views[i], photographs.pictures.empty() ? nullptr : &photographs.pictures[i]};
    const ImageInfo size = chosen.picture ? ImageInfo{chosen.picture->width, chosen.picture->height}
                                          : read_image_info(chosen.view.picture.string());
    resolve_intrinsics(chosen.view, size.width, size.height);
    names += (names.empty() ? "" : ", ") + chosen.view.name;
    out.push_back(std::move(chosen));
  }
  info("views: {}", names);
  return out;
}

std::optional<MaskExtent> extent_of(const Chosen& chosen) {
  if (chosen.view.mask) return mask_extent(read_mask(chosen.view.mask->string()));
  const Image loaded = chosen.picture ? Image() : read_image(chosen.view.picture.string());
  const Image& picture = chosen.picture ? *chosen.picture : loaded;
  if (picture.channels != 4) return std::nullopt;
  return mask_extent(picture);
}

}  // namespace

std::vector<Camera> cameras_of(const Input& input) {
  std::vector<Camera> out;
  out.reserve(input.views.size());
  for (const PreparedView& view : input.views) out.push_back(view.camera);
  return out;
}

Input prepare_input(const Photographs& photographs, const Config& config, const InputRequest& request) {
  const ViewSet& set = photographs.set;
  const std::vector<Chosen> chosen = choose(photographs, choose_views(set, {request.names, config.views}));
  std::vector<Camera> cameras;
  cameras.reserve(chosen.size());
  for (const Chosen& c : chosen) cameras.push_back(c.view.camera);

  const auto estimate = [&](const std::optional<Eigen::Vector3d>& centre) {
    std::vector<std::optional<MaskExtent>> extents;
    extents.reserve(chosen.size());
    for (const Chosen& c : chosen) extents.push_back(extent_of(c));
    return auto_frame(cameras, extents, centre);
  };
  const ChosenPlacement place = choose_placement(request.placement, set.aabb_center, set.aabb_half, estimate);
  info("{}", place.found);
  check_centre_is_seen(cameras, set.convention, place.placement, request.force);
  check_cube_is_in_front(place_views(cameras, place.placement, config.rebase).cameras, place.placement);

  Input out;
  out.placement = place.placement;
  const Framing framing{config.image, request.fit, place.placement.centre, place.placement.edge};
  for (const Chosen& c : chosen) {
    const std::string mask = c.view.mask ? c.view.mask->string() : "";
    out.views.push_back(c.picture ? prepare_view(c.view.camera, *c.picture, nullptr, framing)
                                  : prepare_view(c.view.camera, c.view.picture.string(), mask, framing));
  }
  return out;
}

}  // namespace vsplat

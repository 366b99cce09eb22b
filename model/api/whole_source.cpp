#include "model/api/whole_source.h"

#include <algorithm>
#include <cmath>

#include "model/api/scene.h"
#include "model/fit/fit_pictures.h"
#include "model/fit/whole_start.h"
#include "model/views/listed_points.h"
#include "model/views/pose_check.h"
#include "model/views/view_choice.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat::api {
namespace {

constexpr int kLookedAt = 8;
constexpr double kRandomOfPixels = 0.15, kMostRandom = 100000;
constexpr double kObjectOfPixels = 0.25;  // Gaussians of the network's object: half of what the scene may grow to

bool has_cube(const ViewSet& set, const InputRequest& input) {
  const PlacementRequest& p = input.placement;
  return p.centre || p.edge || p.auto_frame || set.aabb_center || set.aabb_half;
}

// The number of pixels of a picture as it is fitted, on average.
double pixels_of(const Photographs& photographs, const std::vector<int>& used, int longest) {
  double sum = 0;
  for (const Camera& c : FitPictures(photographs, {}, longest, 0).cameras(used))
    sum += static_cast<double>(c.width) * c.height;
  return sum / static_cast<double>(used.size());
}

}  // namespace

bool is_whole(const Photographs& photographs, const vsplat_fit_options& o, const InputRequest& input,
              const std::vector<int>& used) {
  switch (value_of(o.extent)) {
    case VSPLAT_EXTENT_OBJECT:
      return false;
    case VSPLAT_EXTENT_SCENE:
      if (value_of(o.start) == VSPLAT_FIT_NETWORK) return true;
      if (input.placement.centre || input.placement.edge || input.placement.auto_frame)
        fail(Status::usage, "{}, {} and {} place an object's cube: a whole scene ({}) has one only for the network's",
             Option::center, Option::scale, Option::auto_frame, Option::fit_extent);
      return true;
    case VSPLAT_EXTENT_AUTO:
      break;
    default:
      fail(Status::usage, "options.extent is {}, not a value of vsplat_fit_extent", value_of(o.extent));
  }
  if (value_of(o.start) == VSPLAT_FIT_NETWORK || has_cube(photographs.set, input)) return false;
  const std::vector<int> some = spread_views(photographs.set, used, kLookedAt);
  return std::none_of(some.begin(), some.end(),
                      [&](int view) { return LoadedPhotograph(photographs, view).is_masked(); });
}

FitSource whole_source(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
                       const InputRequest& input, const std::vector<int>& used, int longest) {
  std::vector<Camera> cameras;
  cameras.reserve(used.size());
  for (const int view : used) cameras.push_back(resolved_view(photographs, view).camera);
  WholeStart start;
  start.most = static_cast<long>(o.max_gaussians);
  start.seed = o.seed;
  const double pixels = pixels_of(photographs, used, longest);
  start.random = static_cast<long>(std::ceil(std::min(kMostRandom, kRandomOfPixels * pixels)));
  const auto from = static_cast<vsplat_fit_start>(value_of(o.start));
  FitSource out;
  if (from == VSPLAT_FIT_POINTS) start.points = points_of(photographs);
  if (from == VSPLAT_FIT_AUTO || from == VSPLAT_FIT_NETWORK)
    if (std::optional<ListedPoints> found = listed_points(photographs.set)) start.points = std::move(found->points);
  keep_reliable(start.points);
  out.scattered = from != VSPLAT_FIT_SCENE && start.points.empty();
  start.frame = scene_frame(cameras, start.points);
  if (o.near_plane > 0) start.frame.near = o.near_plane;
  info("{}", start.frame.found);
  warn_of_unlikely_cameras(photographs.set.source.string(), cameras);
  if (const std::string text = cut_by_near(cameras, start.points, start.frame.near); !text.empty()) warn("{}", text);
  out.whole = true;
  out.start.placement = start.frame.placement;
  if (from == VSPLAT_FIT_SCENE) {
    need(o.scene, "options.scene");
    const std::shared_ptr<const Scene> scene = o.scene->now();
    out.start.make = [scene](const std::vector<int>&) { return *scene; };
    return out;
  }
  if (from == VSPLAT_FIT_NETWORK) {
    NetworkObject object = network_object(device, photographs, o, input, used, out.selected);
    out.named = std::move(object.named);
    auto most = static_cast<std::size_t>(std::ceil(kObjectOfPixels * pixels));
    if (start.most > 0) {  // half for the object
      most = std::min(most, static_cast<std::size_t>(start.most + 1) / 2);
      start.most = std::max(start.most - static_cast<long>(most), 1L);
    }
    out.start.make = [start = std::move(start), make = std::move(object.make), cube = object.placed.cube, most,
                      &photographs](const std::vector<int>& views) {
      return with_object(whole_scene(start, photographs, views), make(views), cube, most);
    };
    return out;
  }
  out.start.make = [start = std::move(start), &photographs](const std::vector<int>& views) {
    return whole_scene(start, photographs, views);
  };
  return out;
}

}  // namespace vsplat::api

#include "model/api/fit_source.h"

#include <algorithm>
#include <cmath>

#include "model/api/device.h"
#include "model/api/input.h"
#include "model/api/model.h"
#include "model/api/pass_options.h"
#include "model/api/scene.h"
#include "model/api/selected.h"
#include "model/api/whole_source.h"
#include "model/base/resample.h"
#include "model/base/statistics.h"
#include "model/fit/fit_start.h"
#include "model/reconstruct/reconstruct.h"
#include "model/views/listed_points.h"
#include "model/views/pose_check.h"
#include "model/views/view_choice.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat::api {
namespace {

constexpr double kNearOfDistance = 0.1;  // the near plane is at most at this share of the distance of a camera

float middle(std::vector<float> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The cube about the median Gaussian that holds 95 % of them.
Placement cube_of(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  Placement out;
  std::vector<float> values(g.count);
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < g.count; ++k) values[k] = g.means[3 * k + static_cast<std::size_t>(axis)];
    out.centre[axis] = middle(values, 0.5);
  }
  for (std::size_t k = 0; k < g.count; ++k) {
    double far = 0;
    for (int axis = 0; axis < 3; ++axis)
      far = std::max(far, std::abs(g.means[3 * k + static_cast<std::size_t>(axis)] - out.centre[axis]));
    values[k] = static_cast<float>(far);
  }
  out.edge = std::max(2.2 * middle(values, 0.95), 1e-6);
  out.centre += scene.offset;
  return out;
}

PlacedObject place(const Photographs& photographs, const InputRequest& input, const Scene* scene,
                   const std::vector<int>& used, const std::vector<ColoredPoint>* points = nullptr) {
  const ViewSet& set = photographs.set;
  PlacementRequest request = input.placement;
  const bool centre_open = !request.centre && !set.aabb_center, edge_open = !request.edge && !set.aabb_half;
  if (scene && !request.auto_frame && (centre_open || edge_open)) {
    const Placement cube = cube_of(*scene);
    if (centre_open) request.centre = cube.centre;
    if (edge_open) request.edge = cube.edge;
  }
  const std::vector<int> spread = spread_views(set, used, max_views);
  check_masks_of(photographs, spread);
  const ChosenPlacement chosen = find_placement(photographs, spread, request, points);
  info("{}{}", chosen.found, scene && (centre_open || edge_open) ? " (from where the scene's Gaussians are)" : "");
  std::vector<Camera> cameras;
  cameras.reserve(used.size());
  for (const int view : used) cameras.push_back(resolved_view(photographs, view).camera);
  warn_of_unlikely_cameras(set.source.string(), cameras);
  check_centre_is_seen(cameras, set.convention, chosen, input.force || scene);
  std::vector<double> distances;
  distances.reserve(cameras.size());
  for (const Camera& camera : cameras) distances.push_back((camera.centre() - chosen.placement.centre).norm());
  return {chosen.placement, *std::min_element(distances.begin(), distances.end()), median(distances)};
}

// Sets the frame of the fit. Rates are relative to its unit, and the near plane to the cube, so both are bounded by the
// cameras' distances if the cube reaches beyond them: a cube that is far too large then does not matter.
void frame_by(const PlacedObject& placed, FitSource& out) {
  const double unit = placed.usual > 0 ? std::min(placed.cube.edge, placed.usual) : placed.cube.edge;
  out.start.placement = {placed.cube.centre, unit};
  out.start.cube = placed.cube.edge / unit;
  if (unit < placed.cube.edge) out.farthest_near = kNearOfDistance * placed.nearest;
}

ReconstructOptions reconstruct_options_of(const vsplat_fit_options& o, const Config& config) {
  vsplat_reconstruct_options r = VSPLAT_RECONSTRUCT_OPTIONS_INIT;
  if (o.reconstruct) r = taken(o.reconstruct, r, "options.reconstruct");
  if (r.voxels || r.selection)
    fail(Status::usage,
         "options.reconstruct has a selection of voxels: it belongs to one set of views, but the network also runs on "
         "others");
  if (!(r.near_plane >= 0)) fail(Status::usage, "options.reconstruct.near_plane is {}", r.near_plane);
  ReconstructOptions out;
  out.near = r.near_plane;
  set_passes(out, r);
  if (r.has_seed) out.forward.selection_seed = r.seed;
  out.forward.planned_selected =
      selected_of(r.assume_selected, VSPLAT_ASSUME_SELECTED, config, "options.reconstruct.assume_selected");
  return out;
}

// Number of views that the network gets if none are named.
int view_count(const InputRequest& input, const Config& config) {
  return input.view_count > 0 ? input.view_count : config.views_to_use();
}

// Reconstructs from views of a set. Owns all that it needs except device and photographs.
class Prediction {
 public:
  Prediction(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
             const InputRequest& input, const Placement& placement, std::vector<int> inputs,
             std::shared_ptr<std::vector<int>> selected)
      : device_(device),
        photographs_(photographs),
        model_(o.model),
        crop_(input.crop),
        placement_(placement),
        options_(reconstruct_options_of(o, vsplat_file(o.model).config)),
        named_(!input.names.empty()),
        usual_(view_count(input, vsplat_file(o.model).config)),
        inputs_(std::move(inputs)),
        selected_(std::move(selected)) {}

  Scene operator()(const std::vector<int>& views) const {
    const Config& config = vsplat_file(model_.get()).config;
    const std::vector<int> chosen = chosen_of(views);
    const Framing framing{config.image, crop_, placement_.centre, placement_.edge};
    std::vector<PreparedView> prepared;
    std::vector<Camera> cameras;
    std::string names;
    for (const int view : chosen) {
      LoadedPhotograph photograph(photographs_, view);
      names += (names.empty() ? "" : ", ") + photograph.listed().name;
      const bool masked = photograph.is_masked();
      prepared.push_back(on_white(photograph.framed(framing), masked));
      cameras.push_back(prepared.back().camera);
    }
    verbose("the network gets {}", names);
    check_cube_is_in_front(place_views(cameras, placement_, config.rebase).cameras, placement_);
    const auto network = device_->residents->network(device_->context, model_.get());
    Reconstruction out = reconstruct(device_->context, *network, prepared, placement_, options_);
    device_->context.memory().trim();
    *selected_ = std::move(out.selected);
    return std::move(out.scene);
  }

 private:
  // The usual inputs; if some are left out, the remaining named ones, or a new choice if none were named or remain.
  std::vector<int> chosen_of(const std::vector<int>& views) const {
    std::vector<int> out;
    for (const int view : inputs_)
      if (std::find(views.begin(), views.end(), view) != views.end()) out.push_back(view);
    if (out.size() < inputs_.size() && (!named_ || out.empty())) out = spread_views(photographs_.set, views, usual_);
    return out;
  }

  vsplat_device device_;
  const Photographs& photographs_;
  HandleRef<vsplat_model, vsplat_model_retain, vsplat_model_release> model_;
  Crop crop_;
  Placement placement_;
  ReconstructOptions options_;
  bool named_;
  int usual_;
  std::vector<int> inputs_;
  std::shared_ptr<std::vector<int>> selected_;
};

// The network's inputs if no view is left out.
std::vector<int> inputs_of(const ViewSet& set, const InputRequest& input, const std::vector<int>& used, int usual) {
  if (input.names.empty()) return spread_views(set, used, usual);
  const std::vector<int> out = choose_views(set, {input.names, usual});
  for (const int view : out)
    if (std::find(used.begin(), used.end(), view) == used.end())
      fail(Status::usage, "{}: {} is not among the views that are used", Option::views,
           set.views[static_cast<std::size_t>(view)].name);
  return out;
}

// The start that VSPLAT_FIT_AUTO stands for, of an object.
vsplat_fit_start chosen_start(const Photographs& photographs, const vsplat_fit_options& o, std::size_t used) {
  const auto asked = static_cast<vsplat_fit_start>(value_of(o.start));
  if (asked != VSPLAT_FIT_AUTO) return asked;
  if (o.model && used < kManyViews) return VSPLAT_FIT_NETWORK;
  return listed_points(photographs.set) ? VSPLAT_FIT_POINTS : VSPLAT_FIT_RANDOM;
}

FitSource object_source(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
                        const InputRequest& input, const std::vector<int>& used) {
  FitSource made;
  FitStart& out = made.start;
  const auto always = [&out](Scene scene) {
    out.make = [kept = std::make_shared<const Scene>(std::move(scene))](const std::vector<int>&) { return *kept; };
  };
  const auto most = static_cast<long>(o.max_gaussians);
  switch (chosen_start(photographs, o, used.size())) {
    case VSPLAT_FIT_SCENE: {
      need(o.scene, "options.scene");
      const std::shared_ptr<const Scene> scene = o.scene->now();
      if (scene->gaussians.count == 0) fail(Status::input, "the start has no Gaussian: there is nothing to fit");
      frame_by(place(photographs, input, scene.get(), used), made);
      out.make = [scene](const std::vector<int>&) { return *scene; };
      return made;
    }
    case VSPLAT_FIT_NETWORK: {
      NetworkObject object = network_object(device, photographs, o, input, used, made.selected);
      frame_by(object.placed, made);
      made.named = std::move(object.named);
      out.make = std::move(object.make);
      out.independent = true;
      const Config& config = vsplat_file(o.model).config;
      const int epochs = reconstruct_options_of(o, config).fit_epochs.value_or(config.fit_epochs);
      out.predicted = epochs > 0 ? Predicted::fitted : Predicted::yes;
      return made;
    }
    case VSPLAT_FIT_POINTS: {
      const std::vector<ColoredPoint> points = points_of(photographs);
      const PlacedObject placed = place(photographs, input, nullptr, used, &points);
      frame_by(placed, made);
      always(scene_from_points(points, placed.cube, most));
      return made;
    }
    case VSPLAT_FIT_RANDOM: {
      const PlacedObject placed = place(photographs, input, nullptr, used);
      frame_by(placed, made);
      out.make = [cube = placed.cube, count = most > 0 ? most : kRandomStart, seed = o.seed, &photographs](
                     const std::vector<int>& fitted) { return random_scene(cube, count, seed, photographs, fitted); };
      out.independent = true;
      return made;
    }
    case VSPLAT_FIT_AUTO:  // chosen_start() has another
      break;
  }
  return made;
}

}  // namespace

NetworkObject network_object(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
                             const InputRequest& input, const std::vector<int>& used,
                             std::shared_ptr<std::vector<int>> selected) {
  need(o.model, "options.model");
  NetworkObject out{place(photographs, input, nullptr, used), {}, {}};
  std::vector<int> inputs = inputs_of(photographs.set, input, used, view_count(input, vsplat_file(o.model).config));
  if (!input.names.empty()) out.named = inputs;
  out.make = Prediction(device, photographs, o, input, out.placed.cube, std::move(inputs), std::move(selected));
  return out;
}

std::vector<ColoredPoint> points_of(const Photographs& photographs) {
  if (std::optional<ListedPoints> found = listed_points(photographs.set)) return std::move(found->points);
  return read_colmap_points(photographs.set.source);  // its error says where it searched
}

FitSource fit_source(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
                     const std::vector<int>& used, int longest) {
  if (value_of(o.start) < VSPLAT_FIT_SCENE || value_of(o.start) > VSPLAT_FIT_AUTO)
    fail(Status::usage, "options.start is {}, not a value of vsplat_fit_start", value_of(o.start));
  const InputRequest input = request_of(o.input ? taken(o.input, VSPLAT_INPUT_OPTIONS_INIT, "options.input")
                                                : vsplat_input_options(VSPLAT_INPUT_OPTIONS_INIT));
  FitSource out = is_whole(photographs, o, input, used) ? whole_source(device, photographs, o, input, used, longest)
                                                        : object_source(device, photographs, o, input, used);
  // A scene without an up direction gets the cameras' one; a distant scene gets an offset, since floats would not hold
  // its positions.
  const Eigen::Vector3f up = listed_up(photographs).cast<float>();
  const Eigen::Vector3d offset = offset_for(out.start.placement.centre, out.start.placement.edge);
  out.start.make = [make = std::move(out.start.make), up, offset, near = o.near_plane,
                    farthest = out.farthest_near](const std::vector<int>& fitted) {
    Scene scene = make(fitted);
    if (scene.offset.isZero(0) && !offset.isZero(0)) transform(scene, {}, offset);
    scene.near = static_cast<float>(near > 0 ? near : std::min(static_cast<double>(scene.near), farthest));
    if (!scene.up) scene.up = {up.x(), up.y(), up.z()};
    return scene;
  };
  return out;
}

}  // namespace vsplat::api

// Fitting a scene to the user's pictures.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "model/api/cameras.h"
#include "model/api/device.h"
#include "model/api/fit_source.h"
#include "model/api/input.h"
#include "model/api/model.h"
#include "model/api/plan.h"
#include "model/api/scene.h"
#include "model/fit/fit_plan.h"
#include "model/fit/fit_recipe.h"
#include "model/fit/scene_fit.h"
#include "model/io/views/cameras_json.h"
#include "runtime/fail.h"
#include "runtime/option.h"

using namespace vsplat;
using namespace vsplat::api;

struct vsplat_fit_impl : vsplat::api::Counted {
  HandleRef<vsplat_device, vsplat_device_retain, vsplat_device_release> device;
  HandleRef<vsplat_views, vsplat_views_retain, vsplat_views_release> views;
  Photographs photographs;  // those of `views`, with the masks' meaning in this fit
  std::vector<int> used;
  bool independent = false;
  std::shared_ptr<std::vector<int>> selected;  // shared with FitSource
  std::optional<SceneFit> scene_fit;           // declared after what it uses, so that it is destroyed first
};

namespace {

FitHoldout holdout_of(const vsplat_fit_options& o) {
  FitHoldout out;
  switch (value_of(o.holdout)) {
    case VSPLAT_HOLDOUT_AUTO:
      return out;
    case VSPLAT_HOLDOUT_NONE:
      out.kind = FitHoldout::Kind::none;
      return out;
    case VSPLAT_HOLDOUT_COUNT:
      out.kind = FitHoldout::Kind::count;
      out.count = o.holdout_count;
      return out;
    case VSPLAT_HOLDOUT_NAMES:
      out.kind = FitHoldout::Kind::named;
      out.names = names_of(o.holdout_names, o.num_holdout_names, "options.holdout_names");
      if (out.names.empty()) fail(Status::usage, "options.holdout_names is empty: views to hold out expected");
      return out;
  }
  fail(Status::usage, "options.holdout is {}, not a value of vsplat_holdout", value_of(o.holdout));
}

FitFreeze freeze_of(uint32_t bits) {
  constexpr uint32_t all =
      VSPLAT_FREEZE_MEANS | VSPLAT_FREEZE_SCALES | VSPLAT_FREEZE_ROTATIONS | VSPLAT_FREEZE_OPACITIES | VSPLAT_FREEZE_SH;
  if (bits & ~all) fail(Status::usage, "options.freeze is {}, not made of values of vsplat_freeze", bits);
  if (bits == all) fail(Status::usage, "{} holds every parameter: nothing is left to move", Option::freeze);
  return {(bits & VSPLAT_FREEZE_MEANS) != 0, (bits & VSPLAT_FREEZE_SCALES) != 0, (bits & VSPLAT_FREEZE_ROTATIONS) != 0,
          (bits & VSPLAT_FREEZE_OPACITIES) != 0, (bits & VSPLAT_FREEZE_SH) != 0};
}

FitQuality quality_of(const vsplat_fit_quality& quality) {
  switch (value_of(quality)) {
    case VSPLAT_QUALITY_DRAFT:
      return FitQuality::draft;
    case VSPLAT_QUALITY_NORMAL:
      return FitQuality::normal;
    case VSPLAT_QUALITY_HIGH:
      return FitQuality::high;
  }
  fail(Status::usage, "options.quality is {}, not a value of vsplat_fit_quality", value_of(quality));
}

DensityStrategy density_of(const vsplat_density& density) {
  switch (value_of(density)) {
    case VSPLAT_DENSITY_ERROR:
      return DensityStrategy::error;
    case VSPLAT_DENSITY_MCMC:
      return DensityStrategy::mcmc;
  }
  fail(Status::usage, "options.density is {}, not a value of vsplat_density", value_of(density));
}

// Adds the views' depths.
void set_depth(const vsplat_fit_options& o, Photographs& photographs, FitRequest& request) {
  const int depth = value_of(o.depth);
  if (depth == VSPLAT_FIT_DEPTH_NONE) return;
  if (depth < 0 || depth > VSPLAT_FIT_DEPTH_POINTS)
    fail(Status::usage, "options.depth is {}, not a value of vsplat_fit_depth", depth);
  if (!(o.depth_weight > 0) || !std::isfinite(o.depth_weight))
    fail(Status::usage, "options.depth_weight is {}: a number above 0 expected", o.depth_weight);
  if (request.density == DensityStrategy::error)
    fail(Status::usage, "{} does not go with the density strategy by errors: take mcmc", Option::fit_depth);
  constexpr const char* words[] = {"none", "metric", "relative", "inverse", "points"};
  request.depth = words[depth];
  request.depth_weight = o.depth_weight;
  if (depth == VSPLAT_FIT_DEPTH_RELATIVE) request.depth_kind = DepthKind::relative;
  if (depth == VSPLAT_FIT_DEPTH_INVERSE) request.depth_kind = DepthKind::inverse;
  photographs.depths = depth == VSPLAT_FIT_DEPTH_POINTS
                           ? point_depths(photographs.set)
                           : listed_depths(photographs.set, request.depth_kind == DepthKind::metric);
}

FitBackground background_of(const vsplat_fit_options& o) {
  using Kind = FitBackground::Kind;
  FitBackground out;
  switch (value_of(o.background)) {
    case VSPLAT_BACKGROUND_AUTO:
      return out;
    case VSPLAT_BACKGROUND_COLOUR:
      out.kind = Kind::colour;
      for (std::size_t c = 0; c < 3; ++c) {
        out.colour[c] = o.background_colour[c];
        if (!(out.colour[c] >= 0 && out.colour[c] <= 1))
          fail(Status::usage, "options.background_colour[{}] is {}: 0 to 1 expected", c, out.colour[c]);
      }
      return out;
    case VSPLAT_BACKGROUND_RANDOM:
      out.kind = Kind::random;
      return out;
    case VSPLAT_BACKGROUND_SKY:
      out.kind = Kind::sky;
      return out;
  }
  fail(Status::usage, "options.background is {}, not a value of vsplat_background", value_of(o.background));
}

FitRequest request_of(const vsplat_fit_options& o) {
  FitRequest out;
  out.names = names_of(o.names, o.num_names, "options.names");
  out.holdout = holdout_of(o);
  if (o.steps < 0 || o.steps > INT32_MAX)
    fail(Status::usage, "options.steps is {}: 0 to {} expected", o.steps, INT32_MAX);
  if (!(o.seconds >= 0) || !std::isfinite(o.seconds)) fail(Status::usage, "options.seconds is {}", o.seconds);
  if (o.max_gaussians > INT32_MAX)
    fail(Status::usage, "options.max_gaussians is {}: 0 to {} expected", o.max_gaussians, INT32_MAX);
  if (o.sh_degree < -1 || o.sh_degree > 3)
    fail(Status::usage, "options.sh_degree is {}: -1, or 0 to 3 expected", o.sh_degree);
  if (o.longest < -1) fail(Status::usage, "options.longest is {}: -1, 0, or a number of pixels expected", o.longest);
  if (!(o.near_plane >= 0) || !std::isfinite(o.near_plane))
    fail(Status::usage, "options.near_plane is {}: 0, or a distance in world units expected", o.near_plane);
  out.steps = static_cast<long>(o.steps);
  out.seconds = o.seconds;
  out.max_gaussians = static_cast<long>(o.max_gaussians);
  if (o.sh_degree >= 0) out.degree = o.sh_degree;
  out.quality = quality_of(o.quality);
  out.longest = o.longest < 0 ? longest_of(out.quality) : o.longest;
  out.freeze = freeze_of(o.freeze);
  out.seed = o.seed;
  out.poses = o.poses != 0;
  out.exposure = o.exposure != 0;
  out.antialias = o.antialias != 0;
  out.density = density_of(o.density);
  if (!(o.consolidate >= 0 && o.consolidate <= 1))
    fail(Status::usage, "options.consolidate is {}: 0, or a share of at most 1 expected", o.consolidate);
  out.consolidate = o.consolidate;
  out.background = background_of(o);
  out.checkpoint = o.checkpoint ? o.checkpoint : "";
  out.resume = o.resume != 0;
  if (out.resume && out.checkpoint.empty())
    fail(Status::usage, "{} needs {}, the folder of the state", Option::fit_resume, Option::fit_checkpoint);
  return out;
}

SceneFit& scene_fit_of(vsplat_fit fit) {
  need(fit, "fit");
  return *fit->scene_fit;
}

vsplat_scene new_scene(Scene scene) {
  auto out = std::make_unique<vsplat_scene_impl>();
  out->become(std::make_shared<const Scene>(std::move(scene)));
  return out.release();
}

// Gaussians for a plan, which reads only their number and degree.
Gaussians blank_gaussians(std::size_t count, int degree) {
  Gaussians out;
  out.count = count;
  out.sh_degree = degree;
  out.means.resize(3 * count);
  out.scales.assign(3 * count, 1.0f);
  out.quats.assign(4 * count, 0.5f);
  out.opacities.assign(count, 0.5f);
  out.sh.resize(3 * count * out.sh_count());
  return out;
}

vsplat_fit_progress progress_of(const FitProgress& p) {
  vsplat_fit_progress out = VSPLAT_FIT_PROGRESS_INIT;
  p.phase.copy(out.phase, sizeof out.phase - 1);
  out.step = p.step;
  out.steps = p.steps;
  out.gaussians = static_cast<uint64_t>(p.gaussians);
  out.loss = p.loss;
  out.psnr = p.psnr;
  out.seconds_left = p.seconds_left;
  return out;
}

}  // namespace

vsplat_status vsplat_fit_create(vsplat_device device, vsplat_views views, const vsplat_fit_options* options,
                                vsplat_fit* out_fit) {
  return guarded([&] {
    const DeviceUse use(device);
    need(views, "views");
    need(options, "options");
    need(out_fit, "out_fit");
    const vsplat_fit_options o = taken(options, VSPLAT_FIT_OPTIONS_INIT, "options");
    FitRequest request = request_of(o);
    auto made = std::make_unique<vsplat_fit_impl>();
    made->device = device;
    made->views = views;
    made->photographs = views->photographs;
    made->photographs.masks = masks_of(o.masks);
    made->photographs.invert_masks = o.invert_masks != 0;
    set_depth(o, made->photographs, request);
    made->used = listed_views(made->photographs.set, request.names, Option::fit_views);
    // Frees the scene drawn before and other models' weights.
    device->residents->drop_idle(o.model);
    device->scene.reset();
    device->scene_key.reset();
    device->peak_before = std::max(device->peak_before, device->context.memory().peak());
    device->context.memory().reset_peak();
    FitSource from = fit_source(device, made->photographs, o, made->used, request.longest);
    made->independent = from.start.independent;
    made->selected = from.selected;
    request.spared = from.named;
    request.whole = from.whole;
    request.scattered = from.scattered;
    made->scene_fit.emplace(device->context, made->photographs, std::move(from.start), request);
    *out_fit = made.release();
  });
}

void vsplat_fit_retain(vsplat_fit fit) { retain(fit); }
void vsplat_fit_release(vsplat_fit fit) {
  if (!is_forked()) release(fit);  // as in vsplat_device_release()
}

vsplat_status vsplat_fit_step(vsplat_fit fit, vsplat_fit_progress* out_progress, int32_t* out_more) {
  return guarded([&] {
    SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    need(out_more, "out_more");
    if (out_progress) check_size(*out_progress, "out_progress");
    const bool more = scene_fit.step();
    if (out_progress) give(out_progress, progress_of(scene_fit.progress()), "out_progress");
    *out_more = more ? 1 : 0;
  });
}

vsplat_status vsplat_fit_stop(vsplat_fit fit) {
  return guarded([&] {
    SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    scene_fit.stop();
  });
}

vsplat_status vsplat_fit_get_scene(vsplat_fit fit, vsplat_scene* out_scene) {
  return guarded([&] {
    SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    need(out_scene, "out_scene");
    *out_scene = new_scene(scene_fit.result().scene);
  });
}

vsplat_status vsplat_fit_get_start(vsplat_fit fit, vsplat_scene* out_scene) {
  return guarded([&] {
    const SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    need(out_scene, "out_scene");
    vsplat_scene scene = new_scene(scene_fit.start());
    scene->selected = *fit->selected;
    *out_scene = scene;
  });
}

vsplat_status vsplat_fit_get_result(vsplat_fit fit, vsplat_fit_result* out_result) {
  return guarded([&] {
    SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    require_output(out_result, "out_result");
    const FitResult r = scene_fit.figures();
    vsplat_fit_result out = VSPLAT_FIT_RESULT_INIT;
    out.steps = r.steps;
    out.seconds = r.seconds;
    out.returned = r.start_returned ? 1 : 0;
    out.claimed = fit->independent && std::isfinite(r.start.psnr) && std::isfinite(r.result.psnr) ? 1 : 0;
    out.num_held_out = static_cast<int32_t>(r.held_out.size());
    out.start_psnr = r.start.psnr;
    out.start_ssim = r.start.ssim;
    out.result_psnr = r.result.psnr;
    out.result_ssim = r.result.ssim;
    out.num_outliers = static_cast<int32_t>(r.outliers.size());
    out.sky_psnr = r.over_sky.psnr;
    out.sky_ssim = r.over_sky.ssim;
    std::copy(r.background.begin(), r.background.end(), out.background);
    out.in_turn = r.in_turn ? 1 : 0;
    out.peak = fit->device.get()->context.memory().peak();
    give(out_result, out, "out_result");
  });
}

vsplat_status vsplat_fit_get_settings(vsplat_fit fit, char** out_text) {
  return guarded([&] {
    const SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    need(out_text, "out_text");
    *out_text = new_text(scene_fit.settings());
  });
}

vsplat_status vsplat_fit_get_plan(vsplat_fit fit, vsplat_plan* out_plan) {
  return guarded([&] {
    const SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    require_output(out_plan, "out_plan");
    const FitBudget& budget = scene_fit.memory();
    give(out_plan, plan_of(fit->device.get()->context, budget.fit.stages, budget.fit.peak, true, budget.host),
         "out_plan");
  });
}

vsplat_status vsplat_fit_get_views(vsplat_fit fit, vsplat_fit_views which, int32_t* out_views, size_t capacity,
                                   size_t* out_count) {
  return guarded([&] {
    SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    need(out_count, "out_count");
    need_array(out_views, capacity, "out_views");
    std::vector<int> all;
    switch (value_of(which)) {
      case VSPLAT_FIT_USED:
        all = fit->used;
        break;
      case VSPLAT_FIT_HELD_OUT:
        all = scene_fit.figures().held_out;
        break;
      case VSPLAT_FIT_OUTLIERS:
        all = scene_fit.figures().outliers;
        break;
      default:
        fail(Status::usage, "which is {}, not a value of vsplat_fit_views", value_of(which));
    }
    std::copy_n(all.begin(), std::min(capacity, all.size()), out_views);
    *out_count = all.size();
  });
}

vsplat_status vsplat_fit_get_view(vsplat_fit fit, size_t index, vsplat_camera* out_camera, float* out_pixels,
                                  size_t capacity) {
  return guarded([&] {
    SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    const std::vector<int>& used = fit->used;
    const auto known = [&](int view) { return static_cast<size_t>(view) == index; };
    if (std::none_of(used.begin(), used.end(), known))
      fail(Status::usage, "view {} is not among the {} that are used", index, used.size());
    if (out_camera) check_size(*out_camera, "out_camera");
    const int view = static_cast<int>(index);
    const vsplat_camera camera = describe(scene_fit.camera(view));
    if (out_pixels) {
      const Image picture = scene_fit.picture(view);
      if (capacity < picture.data.size())
        fail(Status::usage, "capacity is {} floats: the picture has {}", capacity, picture.data.size());
      std::copy(picture.data.begin(), picture.data.end(), out_pixels);
    }
    if (out_camera) give(out_camera, camera, "out_camera");
  });
}

vsplat_status vsplat_fit_save_cameras(vsplat_fit fit, const char* path) {
  return guarded([&] {
    SceneFit& scene_fit = scene_fit_of(fit);
    const DeviceUse use(fit->device.get());
    need(path, "path");
    std::vector<Camera> cameras;
    for (const int view : fit->used) {
      cameras.push_back(scene_fit.camera(view));
      cameras.back().file = fit->photographs.set.views[static_cast<size_t>(view)].name;
    }
    write_cameras(path, cameras);
  });
}

vsplat_status vsplat_plan_fit(vsplat_device device, uint64_t gaussians, int32_t sh_degree, int32_t width,
                              int32_t height, vsplat_plan* out_plan) {
  return guarded([&] {
    const DeviceUse use(device);
    require_output(out_plan, "out_plan");
    if (sh_degree < 0 || sh_degree > 3) fail(Status::usage, "sh_degree is {}: 0 to 3 expected", sh_degree);
    if (gaussians < 1 || gaussians > INT32_MAX)
      fail(Status::usage, "gaussians is {}: 1 to {} expected", gaussians, INT32_MAX);
    vsplat_camera any = VSPLAT_CAMERA_INIT;
    any.width = width, any.height = height, any.fx = any.fy = 1;
    const Camera camera = camera_of(any, "the picture");
    const Context& ctx = device->context;
    FitRequest request;
    request.max_gaussians = static_cast<long>(gaussians);
    FitOptions options = fit_recipe(request, kManyViews, {}, 1).options;
    options.grow_every = 1;  // a plan has one step
    FitMemory memory;
    const bool fits =
        fits_within([&] { memory = plan_fit(ctx, blank_gaussians(1, sh_degree), 0.2f, options, camera); });
    const double host = fit_host_bytes(static_cast<long>(gaussians), sh_degree, camera);
    give(out_plan, plan_of(ctx, memory.stages, memory.peak, fits, host), "out_plan");
  });
}

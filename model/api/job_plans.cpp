#include "model/api/job_plans.h"

#include <array>
#include <nlohmann/json.hpp>

#include "model/api/drawing.h"
#include "model/api/selected.h"
#include "model/fit/fitter.h"
#include "model/fit/view_corrections.h"
#include "model/render/render_backward.h"
#include "model/train/training_run.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

using PlanJson = nlohmann::ordered_json;

// Sizes to plan with: a picture usual on a GPU, and as many Gaussians as an object has.
constexpr int kPicture = 512;
constexpr std::uint64_t kGaussians = 100000;

void plan_reconstruction(Context& planner, vsplat_model model) {
  const AnyConfig config = config_of(model);
  const long selected = selected_of(0, VSPLAT_ASSUME_SELECTED, config, "selected");
  for (const int views : {config.taken().usual, config.taken().most})
    (void)plan_network(planner, config, weights_of(model), views, selected);
}

// Plans drawing every kind of scene that a PLY may hold, and the derivatives, with the additional ones of surfels.
void plan_all_drawing(Context& planner) {
  for (const GaussianKind kind : {GaussianKind::volume, GaussianKind::surfel})
    for (const bool exact : {false, true}) plan_drawing(planner, kGaussians, 3, any_camera(kPicture), kind, exact);
  const Camera camera = any_camera(kPicture);
  for (const GaussianKind kind : {GaussianKind::volume, GaussianKind::surfel}) {
    Gaussians any;
    any.count = kGaussians;
    any.sh_degree = 3;
    any.kind = kind;
    const GaussianChunks there = place_on_device(planner, any, static_cast<double>(kPicture) * kPicture);
    const SceneGradient out = zero_gradient(planner, there);
    const auto map = [&](const Shape& shape) { return planner.tensor(shape, Type::f32, "gradient of the picture"); };
    PictureGradient by{map({kPicture, kPicture, 3}), map({kPicture, kPicture}), map({kPicture, kPicture})};
    std::array<double, 6> pose{};
    render_backward(planner, there, camera, {}, by, out, &pose);
    if (kind == GaussianKind::volume) {
      RenderOptions antialiased;
      antialiased.antialias = true;
      render_backward(planner, there, camera, antialiased, by, out, &pose);
      continue;
    }
    by.normal = map({kPicture, kPicture, 3});
    by.distortion = map({kPicture, kPicture});
    render_backward(planner, there, camera, {}, by, out, nullptr);
  }
}

// Plans one step of a fit, with the recipes' additions and the corrections learnt beside the scene.
void plan_fit_step(const Context& ctx, const Gaussians& start, const FitOptions& options) {
  const auto planner = ctx.planner();
  Fitter fitter(*planner, start, 0.2f, {}, options);
  if (options.antialias) fitter.set_cameras({any_camera(kPicture)});
  fitter.plan_grown();
  ExposureCorrection exposure = make_exposure(*planner);
  std::array<double, 6> pose{};
  const FitAside aside{exposure.map.reshaped({12}), exposure.gradient.reshaped({12}), &pose};
  DeviceFitPicture picture{any_camera(kPicture), planner->tensor({kPicture, kPicture, 4}, Type::u8, "picture"),
                           planner->tensor({kPicture, kPicture}, Type::u8, "known"), true};
  if (options.depth_weight > 0) picture.depth = planner->tensor({kPicture, kPicture}, Type::f32, "depth");
  fitter.step(picture, aside);
  move(*planner, exposure, 1e-3);
}

void plan_fitting(const Context& ctx) {
  Gaussians start;
  start.count = 1;
  start.sh_degree = 3;
  start.means.resize(3);
  start.scales.assign(3, 1.0f);
  start.quats.assign(4, 0.5f);
  start.opacities.assign(1, 0.5f);
  start.sh.assign(3 * start.sh_count(), 0.0f);
  FitOptions options;
  options.max_gaussians = static_cast<long>(kGaussians);
  plan_fit_step(ctx, start, options);
  options.ssim_weight = 0.2f;
  options.opacity_weight = options.scale_weight = 0.01f;
  options.drop = 0.1f;
  options.grow_every = 1;
  options.grow_until = 2;
  options.noise = options.pull = 1;
  options.antialias = true;
  options.depth_weight = 0.1f;
  options.depth_kind = DepthKind::inverse;
  options.background.kind = FitBackground::Kind::sky;
  plan_fit_step(ctx, start, options);
}

void plan_training(const Context& planner, const AnyConfig& model) {
  if (planner.precision() != Precision::fp32) return;  // refused, so it launches nothing
  PlanJson config;
  config["model"] = PlanJson::parse(any_to_json(model));
  for (const char* optimizer : {"adamw", "muon"}) {
    config["optimizer"] = optimizer;
    TrainConfig stage = train_config_from_json(config.dump());
    stage.fine_after = stage.surface_after = 0;
    stage.ema = 0.999;
    TrainPlanOptions options;
    options.selected = selected_of(0, VSPLAT_TRAIN_ASSUME_SELECTED, model, "selected");
    plan_step(planner, stage, options);
  }
}

}  // namespace

std::uint32_t vsplat::api::checked_jobs(std::uint32_t jobs, std::uint32_t usual, vsplat_model model) {
  std::uint32_t all = 0;
  for (const PlannedJob& job : kPlannedJobs) all |= job.bit;
  if (jobs & ~all) fail(Status::usage, "options.jobs is {}, not made of values of vsplat_program_jobs", jobs);
  if (jobs == 0) jobs = usual;
  if (jobs & (VSPLAT_PROGRAMS_OF_RECONSTRUCT | VSPLAT_PROGRAMS_OF_TRAIN)) need(model, "model");
  return jobs;
}

void vsplat::api::plan_job(Context& planner, vsplat_model model, vsplat_program_jobs job) {
  if (job == VSPLAT_PROGRAMS_OF_RECONSTRUCT) plan_reconstruction(planner, model);
  if (job == VSPLAT_PROGRAMS_OF_RENDER) plan_all_drawing(planner);
  if (job == VSPLAT_PROGRAMS_OF_FIT) plan_fitting(planner);
  if (job == VSPLAT_PROGRAMS_OF_TRAIN) plan_training(planner, config_of(model));
}

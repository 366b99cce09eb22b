// Every OpenCL program that jobs launch, found by planning them; and what no job of that model launches.
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "model/api/device.h"
#include "model/api/drawing.h"
#include "model/api/model.h"
#include "model/api/selected.h"
#include "model/fit/fitter.h"
#include "model/fit/view_corrections.h"
#include "model/splat/render_backward.h"
#include "model/train/train.h"
#include "runtime/fail.h"
#include "runtime/kernel_files.h"
#include "runtime/program.h"

using namespace vsplat;
using namespace vsplat::api;
using Json = nlohmann::ordered_json;

namespace {

// What is planned with: a GPU's usual picture, and as many Gaussians as an object has.
constexpr int kPicture = 512;
constexpr std::uint64_t kGaussians = 100000;

void plan_reconstruct(Context& planner, vsplat_model model) {
  const AnyConfig config = config_of(model);
  const long selected = selected_of(0, VSPLAT_ASSUME_SELECTED, config, "selected");
  for (const int views : {config.taken().usual, config.taken().most})
    (void)plan_network(planner, config, weights_of(model), views, selected);
}

// Whatever a PLY may hold, and the derivatives, of all that surfels' pictures have, too.
void plan_render(Context& planner) {
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
    if (kind != GaussianKind::surfel) continue;
    by.normal = map({kPicture, kPicture, 3});
    by.distortion = map({kPicture, kPicture});
    render_backward(planner, there, camera, {}, by, out, nullptr);
  }
}

// One step of a fit, with what the recipes add to it, and what is learnt beside the scene.
void plan_fit_step(const Context& ctx, const Gaussians& start, const FitOptions& options) {
  const auto planner = ctx.planner();
  Fitter fitter(*planner, start, 0.2f, {}, options);
  fitter.plan_grown();
  ExposureCorrection exposure = make_exposure(*planner);
  std::array<double, 6> pose{};
  const FitAside aside{exposure.map.reshaped({12}), exposure.gradient.reshaped({12}), &pose};
  fitter.step({any_camera(kPicture), planner->tensor({kPicture, kPicture, 4}, Type::u8, "picture"),
               planner->tensor({kPicture, kPicture}, Type::u8, "known"), true},
              aside);
  move(*planner, exposure, 1e-3);
}

void plan_refine(const Context& ctx) {
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
  plan_fit_step(ctx, start, options);
}

void plan_training(const Context& planner, const AnyConfig& model) {
  Json config;
  config["model"] = Json::parse(any_to_json(model));
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

struct Job {
  vsplat_program_jobs bit;
  const char* name;
};
constexpr std::array<Job, 4> kJobs = {{{VSPLAT_PROGRAMS_OF_RECONSTRUCT, "reconstruct"},
                                       {VSPLAT_PROGRAMS_OF_RENDER, "render"},
                                       {VSPLAT_PROGRAMS_OF_REFINE, "refine"},
                                       {VSPLAT_PROGRAMS_OF_TRAIN, "train"}}};

NotedKernels launched_by(const Context& ctx, vsplat_model model, vsplat_program_jobs job) {
  NotedKernels out;
  const auto planner = ctx.planner(false);
  planner->collect(out);
  if (job == VSPLAT_PROGRAMS_OF_RECONSTRUCT) plan_reconstruct(*planner, model);
  if (job == VSPLAT_PROGRAMS_OF_RENDER) plan_render(*planner);
  if (job == VSPLAT_PROGRAMS_OF_REFINE) plan_refine(*planner);
  if (job == VSPLAT_PROGRAMS_OF_TRAIN) plan_training(*planner, config_of(model));
  return out;
}

// A kernel of a program, by who launches it.
using Launches = std::map<std::string, std::set<NotedLaunch>>;
struct Program {
  std::string file, defines;
  auto operator<=>(const Program&) const = default;
};
using Programs = std::map<Program, std::map<std::string, Launches>>;

void add_launched(Programs& to, const Context& ctx, vsplat_model model, uint32_t jobs) {
  for (const Job& job : kJobs) {
    if (!(jobs & job.bit)) continue;
    for (const auto& [kernel, launches] : launched_by(ctx, model, job.bit))
      to[{kernel.file, kernel.defines}][kernel.name][job.name].insert(launches.begin(), launches.end());
  }
}

// Each kernel that is not in the list yet, with its file's own defines.
void add_others(Programs& to, const std::vector<KernelFile>& files, Flavour flavour) {
  std::set<std::string> there;
  for (const auto& [program, kernels] : to)
    for (const auto& [name, launches] : kernels) there.insert(program.file + "\n" + name);
  for (const KernelFile& file : files)
    for (const std::string& kernel : file.kernels)
      if ((flavour == Flavour::gpu ? is_of_gpu(file, kernel) : is_of_cpu(file, kernel)) &&
          there.count(file.name + "\n" + kernel) == 0)
        to[{file.name, ""}][kernel];
}

Json json_of(const Launches& by) {
  Json out = Json::array();
  for (const auto& [job, launches] : by)
    for (const NotedLaunch& launch : launches) {
      Json one;
      one["job"] = job;
      one["stage"] = launch.stage;
      one["group"] = launch.group[0] > 0 ? Json(launch.group) : Json();
      one["local_bytes"] = launch.local_bytes;
      out.push_back(std::move(one));
    }
  return out;
}

// The bytes of local memory that a kernel declares; null, with why, where the device's compiler does not take it.
void add_local_memory(Json& to, Context& ctx, const NamedKernel& kernel) {
  try {
    to["local_memory"] = ctx.local_memory(kernel);
  } catch (const Error& e) {
    if (e.status() == Status::cancelled) throw;
    to["local_memory"] = Json();
    to["error"] = e.what();
  }
}

}  // namespace

vsplat_status vsplat_device_programs(vsplat_device device, vsplat_model model, const vsplat_programs_options* options,
                                     char** out_text) {
  return guarded([&] {
    const DeviceUse use(device);
    need(out_text, "out_text");
    const vsplat_programs_options o = taken(options, VSPLAT_PROGRAMS_OPTIONS_INIT, "options");
    constexpr uint32_t all = VSPLAT_PROGRAMS_OF_RECONSTRUCT | VSPLAT_PROGRAMS_OF_RENDER | VSPLAT_PROGRAMS_OF_REFINE |
                             VSPLAT_PROGRAMS_OF_TRAIN;
    if (o.jobs & ~all) fail(Status::usage, "options.jobs is {}, not made of values of vsplat_program_jobs", o.jobs);
    if (o.jobs & (VSPLAT_PROGRAMS_OF_RECONSTRUCT | VSPLAT_PROGRAMS_OF_TRAIN)) need(model, "model");
    Context& ctx = device->context;
    const std::vector<KernelFile> files = kernel_files();
    Programs programs;
    add_launched(programs, ctx, model, o.jobs);
    if (o.others) add_others(programs, files, ctx.flavour());
    Json out;
    out["device"] = ctx.device().name;
    out["driver"] = ctx.device().driver;
    out["flavour"] = name_of(ctx.flavour());
    out["allowed"] = allowed_scratch();
    out["programs"] = Json::array();
    double done = 0;
    for (const auto& [program, kernels] : programs) {
      if (o.progress && !o.progress(o.user, "programs", done++ / static_cast<double>(programs.size())))
        fail(Status::cancelled, "stopped with {} of {} programs listed", done - 1, programs.size());
      Json one;
      one["name"] = program.file;
      one["options"] = build_options(program.defines);
      for (const KernelFile& file : files)
        if (file.name == program.file && !file.targets.empty()) one["targets"] = file.targets;
      if (o.sources) one["text"] = expanded_source(program.file);
      one["kernels"] = Json::array();
      for (const auto& [name, by] : kernels) {
        Json kernel;
        kernel["name"] = name;
        kernel["launches"] = json_of(by);
        if (o.build) add_local_memory(kernel, ctx, {program.file, name, program.defines});
        one["kernels"].push_back(std::move(kernel));
      }
      out["programs"].push_back(std::move(one));
    }
    *out_text = new_text(out.dump(-1, ' ', false, Json::error_handler_t::replace));
  });
}

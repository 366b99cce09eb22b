// Reconstruction, and the memory it needs.
#include "model/reconstruct/reconstruct.h"

#include <algorithm>
#include <cmath>

#include "model/api/device.h"
#include "model/api/input.h"
#include "model/api/model.h"
#include "model/api/pass_options.h"
#include "model/api/plan.h"
#include "model/api/scene.h"
#include "model/api/selected.h"
#include "model/io/archive/selection_file.h"
#include "model/networks/genden/densifier.h"
#include "model/networks/params/systems.h"
#include "model/reconstruct/inputs_fit.h"
#include "runtime/fail.h"
#include "runtime/option.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

std::optional<std::vector<int>> selection_of(const vsplat_reconstruct_options& o, long voxels) {
  need_array(o.voxels, o.num_voxels, "options.voxels");
  if (o.selection && o.voxels)
    fail(Status::usage, "options.selection (a file) and options.voxels (a list) are both set: give one of them");
  if (o.selection) return read_selection(o.selection, voxels);
  if (!o.voxels) return std::nullopt;
  for (size_t i = 0; i < o.num_voxels; ++i)
    if (o.voxels[i] < 0 || o.voxels[i] >= voxels || (i > 0 && o.voxels[i] <= o.voxels[i - 1]))
      fail(Status::usage, "options.voxels[{}] is {}: ascending indices below {} expected", i, o.voxels[i], voxels);
  return std::vector<int>(o.voxels, o.voxels + o.num_voxels);
}

// Host memory: the model as read, the pictures as the network gets them, and the Gaussians of every pass and once more
// in the scene.
double host_bytes(int image, const Weights& weights, int views, long gaussians, int passes) {
  double values = 0;
  for (const auto& [name, tensor] : weights.all()) values += static_cast<double>(tensor.data.size());
  values += 3.0 * views * image * image;
  constexpr double values_of_gaussian = 59;  // with spherical harmonics of degree 3
  values += (1 + std::min(passes, views)) * values_of_gaussian * static_cast<double>(gaussians);
  return values * sizeof(float);
}

// Number of cells in which Gaussians are merged: those of the cube, and one beyond each face.
long most_cells(const TakenViews& taken) {
  const long edge = std::lround(std::ceil(taken.cells / taken.merge_cell)) + 2;
  return edge * edge * edge;
}

// The fit runs after the network, whose weights stay.
void add_fit(const Context& ctx, long gaussians, int sh_degree, int image, MemoryPlan& plan) {
  const auto planner = ctx.planner();
  plan_inputs_fit(*planner, gaussians, sh_degree, image);
  StageMemory stage{"fit", 0, 0};
  for (const StageMemory& s : planner->stage_memory()) {
    stage.peak_reserved = std::max(stage.peak_reserved, plan.weights + s.peak_reserved);
    stage.peak_live = std::max(stage.peak_live, plan.weights + s.peak_live);
  }
  plan.stages.push_back(stage);
  plan.peak = std::max(plan.peak, plan.weights + planner->memory().peak());
}

// Number of Gaussians that the network makes from so many selected voxels.
long made_of(const Config& config, long selected) { return selected * (config.fine_count + 1); }
long made_of(const LaraConfig&, long selected) { return selected; }
long made_of(const VsplatGendenConfig& config, long selected) {
  return densified_count(config.densify, made_of(static_cast<const Config&>(config), selected));
}
long made_of(const GendenConfig& config, long selected) { return densified_count(config.densify, selected); }

// Refuses options that only VS-Splat supports. (GenDen takes the seed for the order of its curves.)
void refuse_selection(const vsplat_reconstruct_options& o, const AnyConfig& config) {
  if (o.selection || o.voxels)
    fail(Status::usage, "{} selects no voxels: {} is an option of {}", config.network(), Option::selection,
         VsplatSystem::network);
  if (o.has_seed && !config.get_if<GendenConfig>())
    fail(Status::usage, "{} selects no voxels: {} is an option of {}", config.network(), Option::selection_seed,
         VsplatSystem::network);
}

}  // namespace

vsplat_status vsplat_reconstruct(vsplat_device device, vsplat_model model, vsplat_input input,
                                 const vsplat_reconstruct_options* options, vsplat_scene* out_scene) {
  return guarded([&] {
    const DeviceUse use(device);
    need(model, "model");
    need(input, "input");
    need(out_scene, "out_scene");
    const vsplat_reconstruct_options o = taken(options, VSPLAT_RECONSTRUCT_OPTIONS_INIT, "options");
    if (!(o.near_plane >= 0)) fail(Status::usage, "options.near_plane is {}", o.near_plane);
    ReconstructOptions how;
    how.near = o.near_plane;
    how.dump = o.dump ? o.dump : "";
    set_passes(how, o);
    how.masked = input->input.masked;
    std::optional<std::vector<int>> selection;
    const AnyConfig config = config_of(model);
    how.forward.planned_selected =
        selected_of(o.assume_selected, VSPLAT_ASSUME_SELECTED, config, "options.assume_selected");
    if (config.as<Config>()) {
      selection = selection_of(o, config.selectable());
      if (selection) how.forward.selection = &*selection;
    } else {
      refuse_selection(o, config);
    }
    if (o.has_seed) how.forward.selection_seed = o.seed;
    if (o.progress)
      how.forward.progress = [&o](const std::string& stage, double done) {
        if (!o.progress(o.user, stage.c_str(), done)) fail(Status::cancelled, "stopped before stage {}", stage);
      };
    Reconstruction made = retry_with_memory_freed(device, model, [&] {
      const auto network = device->residents->network(device->context, model);
      return reconstruct(device->context, *network, input->input.views, input->input.placement, how);
    });
    made.scene.up = up_of(o.up, "options.up");
    if (!made.scene.up) {
      const Eigen::Vector3f up = input->up.cast<float>();
      made.scene.up = {up.x(), up.y(), up.z()};
    }
    auto scene = std::make_unique<vsplat_scene_impl>();
    scene->become(std::make_shared<const Scene>(std::move(made.scene)));
    scene->selected = std::move(made.selected);
    *out_scene = scene.release();
  });
}

vsplat_status vsplat_plan_reconstruct(vsplat_device device, vsplat_model model, int32_t views, double selected,
                                      vsplat_plan* out_plan) {
  return guarded([&] {
    const DeviceUse use(device);
    need(model, "model");
    require_output(out_plan, "out_plan");
    const AnyConfig config = config_of(model);
    const int most = config.taken().most;
    if (views < 1 || views > most) fail(Status::usage, "{} views: 1 to {} expected", views, most);
    const Context& ctx = device->context;
    const Weights& weights = weights_of(model);
    const long planned = selected_of(selected, VSPLAT_ASSUME_SELECTED, config, "selected");
    MemoryPlan plan;
    const TakenViews taken = config.taken();
    const long made = config.visit([&](const auto& c) { return made_of(c, planned); });
    const bool fits = fits_within([&] {
      plan = plan_network(ctx, config, weights, views, planned);
      if (taken.fit_epochs > 0) {
        const long all = made * std::min(taken.passes, views);
        const long gaussians = taken.merge_cell > 0 ? std::min(made, most_cells(taken)) : all;
        const int degree = config.visit([](const auto& c) { return c.sh_degree; });
        add_fit(ctx, gaussians, degree, taken.image, plan);
      }
    });
    const double host = host_bytes(config.image(), weights, views, made, taken.passes);
    give(out_plan, plan_of(ctx, plan.stages, plan.peak, fits, host), "out_plan");
  });
}

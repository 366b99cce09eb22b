// One forward pass, and what it needs.
#include "model/reconstruct/reconstruct.h"

#include "model/api/device.h"
#include "model/api/input.h"
#include "model/api/model.h"
#include "model/api/plan.h"
#include "model/api/scene.h"
#include "model/api/selected.h"
#include "model/io/selection_file.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

std::optional<std::vector<int>> selection_of(const vsplat_reconstruct_options& o, long voxels) {
  need_array(o.voxels, o.num_voxels, "options.voxels");
  if (o.selection && o.voxels) fail(Status::usage, "options has both a list and a file of voxels");
  if (o.selection) return read_selection(o.selection, voxels);
  if (!o.voxels) return std::nullopt;
  for (size_t i = 0; i < o.num_voxels; ++i)
    if (o.voxels[i] < 0 || o.voxels[i] >= voxels || (i > 0 && o.voxels[i] <= o.voxels[i - 1]))
      fail(Status::usage, "options.voxels[{}] is {}: ascending indices below {} expected", i, o.voxels[i], voxels);
  return std::vector<int>(o.voxels, o.voxels + o.num_voxels);
}

// The model as it was read, the pictures as the network gets them, and its Gaussians twice: here and in the scene.
double host_bytes(const Config& config, const Weights& weights, int views, long selected) {
  double values = 0;
  for (const auto& [name, tensor] : weights.all()) values += static_cast<double>(tensor.data.size());
  values += 3.0 * views * config.image * config.image;
  constexpr double values_of_gaussian = 59;  // with spherical harmonics of degree 3
  values += 2 * values_of_gaussian * static_cast<double>(selected) * (config.fine_count + 1);
  return values * sizeof(float);
}

}  // namespace

vsplat_status vsplat_reconstruct(vsplat_device device, vsplat_model model, vsplat_input input,
                                 const vsplat_reconstruct_options* options, vsplat_scene* out_scene) {
  return guarded([&] {
    need(device, "device");
    need(model, "model");
    need(input, "input");
    need(out_scene, "out_scene");
    const vsplat_reconstruct_options o = taken(options, VSPLAT_RECONSTRUCT_OPTIONS_INIT, "options");
    if (!(o.near_plane >= 0)) fail(Status::usage, "options.near_plane is {}", o.near_plane);
    ReconstructOptions how;
    how.near = o.near_plane;
    how.dump = o.dump ? o.dump : "";
    how.masked = input->input.masked;
    how.forward.planned_selected =
        voxels_of(o.assume_selected, VSPLAT_ASSUME_SELECTED, vsplat_file(model).config, "options.assume_selected");
    if (o.has_seed) how.forward.selection_seed = o.seed;
    const std::optional<std::vector<int>> selection = selection_of(o, vsplat_file(model).config.voxels());
    if (selection) how.forward.selection = &*selection;
    if (o.progress)
      how.forward.progress = [&o](const std::string& stage, double done) {
        if (!o.progress(o.user, stage.c_str(), done)) fail(Status::cancelled, "stopped before stage {}", stage);
      };
    Reconstruction made =
        reconstruct(device->context, model_on(device, model), input->input.views, input->input.placement, how);
    made.scene.up = up_of(o.up, "options.up");
    if (!made.scene.up) {
      const Eigen::Vector3f up = input->up.cast<float>();
      made.scene.up = {up.x(), up.y(), up.z()};
    }
    auto scene = std::make_unique<vsplat_scene_impl>();
    scene->scene = std::make_shared<const Scene>(std::move(made.scene));
    scene->selected = std::move(made.selected);
    *out_scene = scene.release();
  });
}

vsplat_status vsplat_plan_reconstruct(vsplat_device device, vsplat_model model, int32_t views, double selected,
                                      vsplat_plan* out_plan) {
  return guarded([&] {
    need(device, "device");
    need(model, "model");
    if (views < 1 || views > max_views) fail(Status::usage, "{} views: 1 to {} expected", views, max_views);
    const Context& ctx = device->context;
    const Config& config = vsplat_file(model).config;
    const long planned = voxels_of(selected, VSPLAT_ASSUME_SELECTED, config, "selected");
    MemoryPlan plan;
    const bool fits =
        fits_within([&] { plan = VsplatModel::plan(ctx, config, vsplat_file(model).weights, views, planned); });
    give(out_plan,
         plan_of(ctx, plan.stages, plan.peak, fits, host_bytes(config, vsplat_file(model).weights, views, planned)),
         "out_plan");
  });
}

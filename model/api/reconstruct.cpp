// One forward pass, and what it needs.
#include "model/reconstruct/reconstruct.h"

#include "model/api/device.h"
#include "model/api/input.h"
#include "model/api/model.h"
#include "model/api/plan.h"
#include "model/api/scene.h"
#include "model/api/selected.h"
#include "model/io/selection_file.h"
#include "model/params/systems.h"
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
double host_bytes(int image, const Weights& weights, int views, long gaussians) {
  double values = 0;
  for (const auto& [name, tensor] : weights.all()) values += static_cast<double>(tensor.data.size());
  values += 3.0 * views * image * image;
  constexpr double values_of_gaussian = 59;  // with spherical harmonics of degree 3
  values += 2 * values_of_gaussian * static_cast<double>(gaussians);
  return values * sizeof(float);
}

// What only VS-Splat's network has. (GenDen's takes the seed for the order of its curves.)
void refuse_selection(const vsplat_reconstruct_options& o, bool takes_seed) {
  const char* network = takes_seed ? GendenSystem::network : LaraSystem::network;
  if (o.selection || o.voxels)
    fail(Status::usage, "{} selects no voxels: vsplat_reconstruct_options.selection and .voxels are of {}", network,
         VsplatSystem::network);
  if (o.has_seed && !takes_seed)
    fail(Status::usage, "{} selects no voxels: vsplat_reconstruct_options.seed is of {}", network,
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
    how.masked = input->input.masked;
    std::optional<std::vector<int>> selection;
    if (model->lara || model->genden) {
      refuse_selection(o, model->genden != nullptr);
      const LaraConfig& config = model->lara ? model->lara->config : model->genden->config;
      how.forward.planned_selected =
          primitives_of(o.assume_selected, VSPLAT_ASSUME_SELECTED, config, "options.assume_selected");
    } else {
      const Config& config = model->vsplat_genden ? model->vsplat_genden->config : vsplat_file(model).config;
      how.forward.planned_selected =
          voxels_of(o.assume_selected, VSPLAT_ASSUME_SELECTED, config, "options.assume_selected");
      selection = selection_of(o, config.voxels());
      if (selection) how.forward.selection = &*selection;
    }
    if (o.has_seed) how.forward.selection_seed = o.seed;
    if (o.progress)
      how.forward.progress = [&o](const std::string& stage, double done) {
        if (!o.progress(o.user, stage.c_str(), done)) fail(Status::cancelled, "stopped before stage {}", stage);
      };
    const auto run = [&](const auto& network) {
      return reconstruct(device->context, network, input->input.views, input->input.placement, how);
    };
    Reconstruction made = model->lara            ? run(lara_on(device, model))
                          : model->genden        ? run(genden_on(device, model))
                          : model->vsplat_genden ? run(vsplat_genden_on(device, model))
                                                 : run(model_on(device, model));
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
    const DeviceUse use(device);
    need(model, "model");
    const int most = taken_views(model).most;
    if (views < 1 || views > most) fail(Status::usage, "{} views: 1 to {} expected", views, most);
    const Context& ctx = device->context;
    MemoryPlan plan;
    double host = 0;
    bool fits = false;
    const auto plan_of_primitives = [&](const auto& file, const auto& of_model, const auto& count) {
      const long planned = primitives_of(selected, VSPLAT_ASSUME_SELECTED, file.config, "selected");
      fits = fits_within([&] { plan = of_model(file, planned); });
      host = host_bytes(file.config.image, file.weights, views, count(planned));
    };
    if (model->lara) {
      plan_of_primitives(
          *model->lara,
          [&](const auto& f, long kept) { return LaraModel::plan(ctx, f.config, f.weights, views, kept); },
          [](long kept) { return kept; });
    } else if (model->genden) {
      plan_of_primitives(
          *model->genden,
          [&](const auto& f, long kept) { return GendenModel::plan(ctx, f.config, f.weights, views, kept); },
          [&](long kept) { return densified_count(model->genden->config.densify, kept); });
    } else if (model->vsplat_genden) {
      const VsplatGendenModelFile& file = *model->vsplat_genden;
      const long planned = voxels_of(selected, VSPLAT_ASSUME_SELECTED, file.config, "selected");
      fits = fits_within([&] { plan = VsplatGendenModel::plan(ctx, file.config, file.weights, views, planned); });
      const long gaussians = densified_count(file.config.densify, planned * (file.config.fine_count + 1));
      host = host_bytes(file.config.image, file.weights, views, gaussians);
    } else {
      const ModelFile& file = vsplat_file(model);
      const long planned = voxels_of(selected, VSPLAT_ASSUME_SELECTED, file.config, "selected");
      fits = fits_within([&] { plan = VsplatModel::plan(ctx, file.config, file.weights, views, planned); });
      host = host_bytes(file.config.image, file.weights, views, planned * (file.config.fine_count + 1));
    }
    give(out_plan, plan_of(ctx, plan.stages, plan.peak, fits, host), "out_plan");
  });
}

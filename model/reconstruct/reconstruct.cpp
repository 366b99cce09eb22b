#include "model/reconstruct/reconstruct.h"

#include <nlohmann/json.hpp>

#include "model/params/systems.h"
#include "model/reconstruct/dump.h"
#include "model/reconstruct/selection_check.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {

namespace {

Tensor upload_pictures(Context& ctx, const std::vector<PreparedView>& views, int edge) {
  std::vector<float> values;
  values.reserve(views.size() * static_cast<std::size_t>(edge) * edge * 3);
  for (const PreparedView& view : views) {
    const Image& image = view.image;
    if (image.width != edge || image.height != edge || image.channels != 3)
      fail(Status::usage, "{}: a picture of {} x {} with {} channels, the model takes {} x {} with 3", view.camera.file,
           image.width, image.height, image.channels, edge, edge);
    values.insert(values.end(), image.data.begin(), image.data.end());
  }
  return ctx.upload({static_cast<long>(views.size()), edge, edge, 3}, values, Type::f32, "pictures");
}

void add_inputs(Dump& dump, const PlacedViews& placed) {
  std::vector<float> c2w, k;
  for (const Camera& camera : placed.cameras) {
    const Eigen::Matrix4d m = camera.c2w();
    for (int i = 0; i < 16; ++i) c2w.push_back(static_cast<float>(m(i / 4, i % 4)));
    for (const double v : {camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0})
      k.push_back(static_cast<float>(v));
  }
  const long views = static_cast<long>(placed.cameras.size());
  dump.add("input.c2w", {views, 4, 4}, c2w);
  dump.add("input.K", {views, 3, 3}, k);
}

struct Made {
  DeviceGaussians final;
  std::vector<int> selected;
};

// What the networks' runs share: run(pictures, cameras, tap) -> Made, between the world and the object's frame.
template <class Config, class Run>
Reconstruction in_object_frame(Context& ctx, const Config& config, const std::vector<PreparedView>& views,
                               const Placement& placement, const ReconstructOptions& options, Dump& dump,
                               const Run& run) {
  std::vector<Camera> cameras;
  cameras.reserve(views.size());
  for (const PreparedView& view : views) cameras.push_back(view.camera);
  const PlacedViews placed = place_views(cameras, placement, config.rebase);
  auto tap = options.forward.tap;
  if (!options.dump.empty()) {
    tap = dump.tap(ctx);
    add_inputs(dump, placed);
  }
  Reconstruction out;
  {
    const Tensor pictures = upload_pictures(ctx, views, config.image);
    if (!options.dump.empty()) dump.add("input.images", pictures.shape(), ctx.read<float>(pictures));
    const Made made = run(pictures, placed.cameras, tap);
    out.selected = made.selected;
    out.scene.gaussians = download(ctx, made.final);
  }
  ctx.finish();
  out.scene.near = static_cast<float>(kNearInObject);
  if (config.negate_camera_centre) out.scene.mirror = std::array<float, 3>{0, 0, 0};
  transform(out.scene, placed.to_world, offset_for(placement.centre, placement.edge));
  if (options.near > 0) out.scene.near = static_cast<float>(options.near);
  return out;
}

void write(Dump& dump, const ReconstructOptions& options, const char* system, const std::string& config,
           std::size_t views) {
  if (!options.dump.empty())
    dump.write(options.dump, {{"system", system}, {"config", config}, {"views", std::to_string(views)}});
}

}  // namespace

namespace {

// What VS-Splat's network is given and asked for, with or without a densifier: run(pictures, cameras, options) -> Made.
template <class Config, class Run>
Reconstruction of_voxels(Context& ctx, const Config& config, const char* system, const std::vector<PreparedView>& views,
                         const Placement& placement, const ReconstructOptions& options, const Run& run) {
  if (views.empty() || views.size() > 16)
    fail(Status::usage, "{} views given, the network takes 1 to 16", views.size());
  Dump dump;
  Reconstruction out =
      in_object_frame(ctx, config, views, placement, options, dump,
                      [&](const Tensor& pictures, const std::vector<Camera>& cameras, const auto& tap) {
                        ForwardOptions forward = options.forward;
                        forward.tap = tap;
                        return run(pictures, cameras, forward);
                      });
  if (out.scene.gaussians.count == 0) warn("no voxel was selected: the scene is empty");
  if (!options.forward.selection) {
    const bool background = !options.masked && shows_background(views);
    const std::string doubts = doubts_about(selected_shares(out.selected, config.volume), config.volume, background);
    if (!doubts.empty()) warn("{}", doubts);
  }
  if (!options.dump.empty() && config.levels != "coarse") dump.add_coords(out.selected, config.volume);
  write(dump, options, system, to_json(config), views.size());
  return out;
}

}  // namespace

Reconstruction reconstruct(Context& ctx, const VsplatModel& model, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options) {
  return of_voxels(ctx, model.config(), VsplatSystem::name, views, placement, options,
                   [&](const Tensor& pictures, const std::vector<Camera>& cameras, const ForwardOptions& forward) {
                     const ForwardResult result = model.forward(ctx, pictures, upload_cameras(ctx, cameras), forward);
                     return Made{result.final, result.selected};
                   });
}

Reconstruction reconstruct(Context& ctx, const VsplatGendenModel& model, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options) {
  return of_voxels(ctx, model.config(), VsplatGendenSystem::name, views, placement, options,
                   [&](const Tensor& pictures, const std::vector<Camera>& cameras, const ForwardOptions& forward) {
                     VsplatGendenOptions dense;
                     dense.backbone = forward;
                     const VsplatGendenResult result = model.forward(ctx, pictures, cameras, dense);
                     return Made{result.final, result.selected};
                   });
}

namespace {

// Of the kept primitives, ascending, K of each voxel.
std::vector<int> voxels_of(const std::vector<int>& kept, int each) {
  std::vector<int> out;
  for (const int primitive : kept)  // those of a voxel lie together
    if (const int voxel = primitive / each; out.empty() || out.back() != voxel) out.push_back(voxel);
  return out;
}

LaraOptions backbone_options(const ReconstructOptions& options,
                             const std::function<void(const std::string&, const Tensor&)>& tap) {
  LaraOptions out;
  out.tap = tap;
  out.progress = options.forward.progress;
  out.planned_kept = options.forward.planned_selected;
  return out;
}

constexpr const char* kEmpty = "every primitive is transparent: the scene is empty";

}  // namespace

Reconstruction reconstruct(Context& ctx, const LaraModel& model, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options) {
  const LaraConfig& config = model.config();
  Dump dump;
  Reconstruction out =
      in_object_frame(ctx, config, views, placement, options, dump,
                      [&](const Tensor& pictures, const std::vector<Camera>& cameras, const auto& tap) {
                        const LaraResult result = model.forward(ctx, pictures, cameras, backbone_options(options, tap));
                        return Made{result.final, voxels_of(result.kept, config.primitives)};
                      });
  if (out.scene.gaussians.count == 0) warn("{}", kEmpty);
  write(dump, options, LaraSystem::name, to_json(config), views.size());
  return out;
}

Reconstruction reconstruct(Context& ctx, const GendenModel& model, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options) {
  const GendenConfig& config = model.config();
  Dump dump;
  Reconstruction out =
      in_object_frame(ctx, config, views, placement, options, dump,
                      [&](const Tensor& pictures, const std::vector<Camera>& cameras, const auto& tap) {
                        GendenOptions forward;
                        forward.backbone = backbone_options(options, tap);
                        forward.seed = options.forward.selection_seed.value_or(0);
                        const GendenResult result = model.forward(ctx, pictures, cameras, forward);
                        return Made{result.final, voxels_of(result.kept, config.primitives)};
                      });
  if (out.scene.gaussians.count == 0) warn("{}", kEmpty);
  write(dump, options, GendenSystem::name, to_json(config), views.size());
  return out;
}

}  // namespace vsplat

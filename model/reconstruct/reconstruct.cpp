#include "model/reconstruct/reconstruct.h"

#include <nlohmann/json.hpp>

#include "model/reconstruct/dump.h"
#include "model/reconstruct/inputs_fit.h"
#include "model/reconstruct/passes.h"
#include "model/reconstruct/selection_check.h"
#include "model/render/supersample.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {

namespace {

std::vector<float> values_of(const std::vector<PreparedView>& views, int edge) {
  std::vector<float> values;
  values.reserve(views.size() * static_cast<std::size_t>(edge) * edge * 3);
  for (const PreparedView& view : views) {
    const Image& image = view.image;
    if (image.width != edge || image.height != edge || image.channels != 3)
      fail(Status::usage, "{}: a picture of {} x {} with {} channels, the model takes {} x {} with 3", view.camera.file,
           image.width, image.height, image.channels, edge, edge);
    values.insert(values.end(), image.data.begin(), image.data.end());
  }
  return values;
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

// A warning if the selection looks wrong, or "". `made`: by VS-Splat's network.
std::string doubts(const Config& config, const Reconstruction& made, const std::vector<PreparedView>& views,
                   bool masked) {
  const bool background = !masked && shows_background(views);
  return doubts_about(selected_shares(made.selected, config.volume), config.volume, background);
}

std::vector<FitPicture> fit_pictures(const std::vector<PreparedView>& views, const std::vector<Camera>& cameras) {
  std::vector<FitPicture> out;
  for (std::size_t i = 0; i < views.size(); ++i)
    out.push_back(fit_picture(views[i].image, views[i].alpha, views[i].masked, cameras[i]));
  return out;
}

constexpr double kShareOfPasses = 0.7;  // of the time, if a fit follows

int epochs_of(const ReconstructOptions& options, const AnyConfig& config) {
  if (options.fit_epochs.value_or(0) > 0 && config.get_if<LaraConfig>())
    fail(Status::usage, "{} is {}: {} makes surfels, and only Gaussians of three scales can be fitted",
         Option::fit_epochs, *options.fit_epochs, config.network());
  if (options.fit_epochs.value_or(0) > 0 && !options.dump.empty())
    fail(Status::usage, "{} is {}: a dump is of the network alone", Option::fit_epochs, *options.fit_epochs);
  return options.dump.empty() ? options.fit_epochs.value_or(config.taken().fit_epochs) : 0;
}

}  // namespace

Reconstruction reconstruct(Context& ctx, const Network& network, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options) {
  const AnyConfig& config = network.config();
  const TakenViews taken = config.taken();
  if (views.empty() || views.size() > static_cast<std::size_t>(taken.most))
    fail(Status::usage, "{} views given, the network takes 1 to {}", views.size(), taken.most);
  std::vector<Camera> cameras;
  cameras.reserve(views.size());
  for (const PreparedView& view : views) cameras.push_back(view.camera);
  const PlacedViews placed = place_views(cameras, placement, taken.rebase);
  Dump dump;
  const bool dumps = !options.dump.empty();
  ForwardOptions forward = options.forward;
  if (dumps) {
    forward.tap = dump.tap(ctx);
    add_inputs(dump, placed);
  }
  PassOptions passes{options.passes.value_or(taken.passes), options.merge_cell.value_or(taken.merge_cell)};
  if (const bool one = dumps || options.forward.selection; one && options.passes.value_or(1) > 1)
    fail(Status::usage, "{} is {}: a selection and a dump are those of one pass", Option::passes, *options.passes);
  else if (one)
    passes.count = 1;
  if (passes.count > 1 && taken.rebase != "rotate")
    fail(Status::usage, "{} is {}: 1 expected, since this model's frame moves with the reference (its rebase is {})",
         Option::passes, passes.count, taken.rebase);
  const int epochs = epochs_of(options, config);
  std::function<void(double)> fit_progress;
  if (epochs > 0 && options.forward.progress) {
    forward.progress = [&](const std::string& stage, double done) {
      options.forward.progress(stage, kShareOfPasses * done);
    };
    fit_progress = [&](double done) { options.forward.progress("fit", kShareOfPasses + (1 - kShareOfPasses) * done); };
  }
  Reconstruction out;
  {
    const std::vector<float> pictures = values_of(views, taken.image);
    if (dumps) dump.add("input.images", {static_cast<long>(views.size()), taken.image, taken.image, 3}, pictures);
    Passes made = forward_passes(ctx, network, pictures, placed.cameras, passes, forward);
    out.selected = std::move(made.first.voxels);
    out.scene.gaussians = std::move(made.final);
  }
  if (epochs > 0)
    out.scene.gaussians = fitted_to_inputs(ctx, out.scene.gaussians, fit_pictures(views, placed.cameras),
                                           {epochs, network.drawing().mirror, fit_progress});
  ctx.finish();
  out.scene.near = static_cast<float>(kNearInObject);
  out.scene.mirror = network.drawing().mirror;
  transform(out.scene, placed.to_world, offset_for(placement.centre, placement.edge));
  out.scene.detail = detail_of(cameras, placement.centre);
  if (auto& detail = out.scene.detail)
    for (int i = 0; i < 3; ++i) detail->at[i] = static_cast<float>(placement.centre[i] - out.scene.offset[i]);
  if (options.near > 0) out.scene.near = static_cast<float>(options.near);
  const Config* own = config.as<Config>();
  if (out.scene.gaussians.count == 0)
    warn("{}: the scene is empty", own ? "no voxel was selected" : "every primitive is transparent");
  if (own && !options.forward.selection)
    if (const std::string text = doubts(*own, out, views, options.masked); !text.empty()) warn("{}", text);
  if (!dumps) return out;
  if (own && config.has_fine()) dump.add_coords(out.selected, own->volume);
  dump.write(options.dump, {{"system", config.system()},
                            {"config", config.visit([](const auto& c) { return to_json(c); })},
                            {"views", std::to_string(views.size())}});
  return out;
}

}  // namespace vsplat

// Does in advance what the first reconstruction and drawing would do once.
#include <numeric>
#include <vector>

#include "model/api/device.h"
#include "model/api/drawing.h"
#include "model/api/selected.h"
#include "model/reconstruct/inputs_fit.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

NotedKernels kernels_of(const Context& ctx, const Network& network, long views, long selected, int sh_degree) {
  NotedKernels out;
  const auto planner = ctx.planner(false);
  planner->collect(out);
  (void)network.plan(*planner, views, selected);
  plan_drawing(*planner, 1000, sh_degree, any_camera(512));
  const TakenViews taken = network.config().taken();
  if (taken.fit_epochs > 0) plan_inputs_fit(*planner, 1000, sh_degree, taken.image);
  return out;
}

void launch_once(Context& ctx, const Network& network, long views, long selected) {
  const AnyConfig& config = network.config();
  const long edge = config.image();
  const std::vector<float> grey(static_cast<std::size_t>(views * edge * edge * 3), 0.5f);
  const std::vector<Camera> cameras(static_cast<std::size_t>(views), any_camera(edge));
  ForwardOptions options;
  options.planned_selected = selected;
  std::vector<int> voxels(static_cast<std::size_t>(selected));  // from grey pictures a network may select none
  std::iota(voxels.begin(), voxels.end(), 0);
  if (config.as<Config>()) options.selection = &voxels;
  const Network::Result made = network.forward(ctx, ctx.upload({views, edge, edge, 3}, grey), cameras, options);
  (void)render(ctx, made.final, cameras.front(), network.drawing());
  if (config.taken().fit_epochs > 0) {
    Image picture(static_cast<int>(edge), static_cast<int>(edge), 3, 0.5f);
    (void)fitted_to_inputs(ctx, download(ctx, made.final), {fit_picture(picture, {}, false, cameras.front())},
                           {1, {}, {}});
  }
  ctx.finish();
}

}  // namespace

vsplat_status vsplat_device_prepare(vsplat_device device, vsplat_model model, const vsplat_prepare_options* options) {
  return guarded([&] {
    const DeviceUse use(device);
    need(model, "model");
    const vsplat_prepare_options o = taken(options, VSPLAT_PREPARE_OPTIONS_INIT, "options");
    const AnyConfig config = config_of(model);
    const long views = o.views != 0 ? o.views : config.taken().usual;
    if (views < 1 || views > config.taken().most)
      fail(Status::usage, "options.views is {}: 1 to {} expected", views, config.taken().most);
    const auto tell = [&](const char* stage, double done) {
      if (o.progress && !o.progress(o.user, stage, done)) fail(Status::cancelled, "stopped in stage {}", stage);
    };
    Context& ctx = device->context;
    tell("weights", 0);
    const auto network = device->residents->network(ctx, model);
    const long selected = selected_of(0, VSPLAT_ASSUME_SELECTED, config, "selected");
    vsplat_model_info info = VSPLAT_MODEL_INFO_INIT;
    if (vsplat_model_get_info(model, &info) != VSPLAT_OK) fail(Status::internal, "{}", vsplat_last_error());
    const NotedKernels kernels = kernels_of(ctx, *network, views, selected, info.sh_degree);
    const double parts = static_cast<double>(kernels.size()) * (o.launch ? 1.25 : 1);
    double done = 0;
    for (const auto& [kernel, noted] : kernels) {
      tell("compile", done++ / parts);
      ctx.build(kernel);
    }
    if (!o.launch) return;
    tell("launch", done / parts);
    retry_with_memory_freed(device, model, [&] { launch_once(ctx, *network, views, selected); });
  });
}

#include "model/reconstruct/inputs_fit.h"

#include "model/base/scene.h"
#include "model/fit/fit_plan.h"
#include "model/fit/fit_recipe.h"
#include "model/fit/fitter.h"
#include "runtime/context.h"

namespace vsplat {

FitPicture fit_picture(const Image& on_white, const Image& alpha, bool masked, const Camera& camera) {
  const std::size_t pixels = on_white.data.size() / 3;
  FitPicture out{camera.file, camera, {}, {}, masked};
  out.rgba.resize(4 * pixels);
  if (!masked && !alpha.empty()) out.known.resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float a = alpha.empty() ? 1.0f : alpha.data[i];
    for (std::size_t c = 0; c < 3; ++c)
      out.rgba[4 * i + c] = byte_of(on_white.data[3 * i + c] - (masked ? 1 - a : 0.0f));
    out.rgba[4 * i + 3] = masked ? byte_of(a) : 255;
    if (!out.known.empty()) out.known[i] = a < 1 ? 0 : 255;
  }
  return out;
}

Gaussians fitted_to_inputs(Context& ctx, const Gaussians& start, const std::vector<FitPicture>& pictures,
                           const InputsFit& fit) {
  if (fit.epochs <= 0 || start.count == 0) return start;
  std::vector<DeviceFitPicture> given;
  for (const FitPicture& picture : pictures)
    if (known_share(picture) > 0) given.push_back(upload(ctx, picture));
  if (given.empty()) return start;
  Fitter fitter(ctx, start, static_cast<float>(kNearInObject), fit.mirror, options_for_predicted());
  const long steps = fit.epochs * static_cast<long>(given.size());
  for (long step = 0; step < steps; ++step) {
    const auto at = static_cast<std::size_t>(step) % given.size();
    if (fit.progress && at == 0) fit.progress(static_cast<double>(step) / static_cast<double>(steps));
    fitter.step(given[at]);
  }
  return fitter.gaussians();
}

void plan_inputs_fit(Context& planner, long count, int sh_degree, int image) {
  Gaussians start;
  start.count = static_cast<std::size_t>(count);
  start.sh_degree = sh_degree;
  start.means.resize(3 * start.count), start.scales.resize(3 * start.count), start.quats.resize(4 * start.count);
  start.opacities.resize(start.count), start.sh.resize(3 * start.sh_count() * start.count);
  Camera camera;
  camera.width = camera.height = image;
  camera.fx = camera.fy = image;
  plan_fit_in(planner, start, static_cast<float>(kNearInObject), options_for_predicted(), camera);
}

}  // namespace vsplat

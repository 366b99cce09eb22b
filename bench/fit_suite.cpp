// A step of a fit: a picture drawn, its loss, all gradients and the optimiser, beside drawing and its derivative
// alone.
#include <algorithm>
#include <cmath>
#include <memory>

#include "bench/bench.h"
#include "bench/render_suite.h"
#include "bench/scenes.h"
#include "model/fit/fitter.h"
#include "model/metrics/metrics.h"

namespace vsplat::bench {

namespace {

struct Data {
  BenchScene scene;
  std::vector<FitPicture> given;
  std::vector<DeviceFitPicture> pictures;
  std::unique_ptr<Fitter> fitter;
  std::size_t next = 0;
};

// The scene as its camera sees it, with its alpha.
FitPicture picture_of(Context& ctx, const BenchScene& scene, const Camera& camera) {
  RenderOptions options;
  options.near = scene.scene.near;
  options.mirror = scene.scene.mirror;
  options.background = {0, 0, 0};
  const Picture drawn = render_picture(ctx, upload(ctx, scene.scene.gaussians), camera, options);
  FitPicture out;
  out.camera = camera;
  out.masked = true;
  const auto byte = [](float v) { return static_cast<std::uint8_t>(std::lround(255.0f * std::clamp(v, 0.0f, 1.0f))); };
  for (std::size_t i = 0; i < drawn.alpha.data.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) out.rgba.push_back(byte(drawn.colour.data[3 * i + c]));
    out.rgba.push_back(byte(drawn.alpha.data[i]));
  }
  return out;
}

// The start: other colours, and every Gaussian a little aside.
Gaussians disturbed(Gaussians g) {
  for (std::size_t i = 0; i < g.means.size(); ++i) g.means[i] += 0.2f * g.scales[i] * (i % 2 ? 1.0f : -1.0f);
  for (std::size_t i = 0; i < g.sh.size(); ++i) g.sh[i] *= 0.9f;
  return g;
}

// How far the fitter's own measure of a picture is from the host's.
double score_error(Context& ctx, const Data& d) {
  RenderOptions options;
  options.near = d.scene.scene.near;
  options.mirror = d.scene.scene.mirror;
  const Camera& camera = d.scene.cameras[0];
  Image drawn = render_picture(ctx, upload(ctx, d.fitter->gaussians()), camera, options).colour;
  Image want(camera.width, camera.height, 3);
  for (float& v : drawn.data) v = std::clamp(v, 0.0f, 1.0f);
  for (std::size_t i = 0; i < want.data.size(); ++i) {
    const auto* pixel = &d.given[0].rgba[i / 3 * 4];
    want.data[i] = (static_cast<float>(pixel[i % 3]) + 255.0f - static_cast<float>(pixel[3])) / 255.0f;
  }
  const double here = psnr(drawn, want), there = d.fitter->score(d.pictures[0]).psnr;
  return std::abs(here - there) / here;
}

Prepared prepare_step(Context& ctx, const std::string& name, const std::string& folder) {
  const auto d = std::make_shared<Data>();
  d->scene = folder.empty() ? make_scene(name) : read_scene(folder, name);
  for (const Camera& camera : d->scene.cameras) {
    d->given.push_back(picture_of(ctx, d->scene, camera));
    d->pictures.push_back(upload(ctx, d->given.back()));
  }
  FitOptions options;
  options.opacity_weight = options.scale_weight = 0.01f;
  options.ssim_weight = 0.2f;
  d->fitter = std::make_unique<Fitter>(ctx, disturbed(d->scene.scene.gaussians), d->scene.scene.near,
                                       d->scene.scene.mirror, options);
  Prepared p;
  p.kind = Kind::fitting;
  p.inputs = static_cast<int>(d->pictures.size());
  p.run = [d] { d->fitter->step(d->pictures[d->next++ % d->pictures.size()]); };
  p.error = [&ctx, d] { return score_error(ctx, *d); };
  p.tolerance = 1e-3;
  return p;
}

}  // namespace

std::vector<Case> fit_cases(const Options& options) {
  std::vector<Case> cases;
  for (const std::string& name : options.scenes.empty() ? scene_names() : scene_names(options.scenes)) {
    cases.push_back(
        {name, [name, folder = options.scenes](Context& ctx) { return prepare_backward(ctx, name, folder); }});
    cases.push_back({name, [name, folder = options.scenes](Context& ctx) { return prepare_step(ctx, name, folder); }});
  }
  return cases;
}

}  // namespace vsplat::bench

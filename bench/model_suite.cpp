// A whole forward of the network: four posed pictures of a drawn scene, random weights, a tenth of the voxels, those
// nearest a sphere, selected, as a trained model selects.
//   paper   at the published size
//   small   the size that the shipped model has
//   tiny    for tests
#include <algorithm>
#include <memory>

#include "bench/bench.h"
#include "bench/case_data.h"
#include "bench/forward_check.h"
#include "bench/pytorch.h"
#include "bench/scenes.h"
#include "model/networks/params/init.h"
#include "model/render/render.h"
#include "model/views/orbit.h"
#include "model/views/placement.h"
#include "runtime/fail.h"

namespace vsplat::bench {
namespace {

constexpr int kModelViews = 4;

struct ModelData {
  ModelInput in;
  std::unique_ptr<VsplatModel> model;
};

// Those of a training that has not begun, and where it would begin with zeros small numbers, that no stage multiplies
// zeros.
Weights weights_without_zeros(const Config& config) {
  const Weights first = initial_weights(config, 1);
  Weights out;
  std::uint32_t seed = 0;
  for (const auto& [name, tensor] : first.all()) {
    HostTensor filled = tensor;
    if (std::all_of(filled.data.begin(), filled.data.end(), [](float v) { return v == 0; }))
      filled.data = random_floats(static_cast<long>(filled.data.size()), ++seed, -0.05f, 0.05f);
    out.set(name, std::move(filled));
  }
  return out;
}

}  // namespace

ModelInput model_input(Context& ctx, const std::string& config) {
  ModelInput in;
  in.config = named_config(config);
  in.weights = weights_without_zeros(in.config);
  in.selection = shell(in.config.volume, static_cast<std::size_t>(in.config.voxels()) / 10);
  const BenchScene scene = make_scene("small-5k");
  const long edge = in.config.image;
  const auto drawn_from =
      orbit_about(scene.cameras, Eigen::Vector3d::Zero(), kModelViews, in.config.image, in.config.image);
  const DeviceGaussians drawn = upload(ctx, scene.scene.gaussians);
  for (const Camera& camera : drawn_from) {
    const Picture picture = render_picture(ctx, drawn, camera, {});
    for (const float value : picture.colour.data) in.pictures.push_back(std::clamp(value, 0.0f, 1.0f));
  }
  in.cameras = place_views(drawn_from, {}, in.config.rebase).cameras;
  in.images = ctx.upload({kModelViews, edge, edge, 3}, in.pictures);
  in.views = upload_cameras(ctx, in.cameras);
  return in;
}

namespace {

Prepared prepare_model(Context& ctx, const std::string& name, double seconds) {
  const auto d = std::make_shared<ModelData>();
  d->in = model_input(ctx, name);
  d->model = std::make_unique<VsplatModel>(ctx, d->in.config, d->in.weights);
  Prepared p;
  p.kind = Kind::network;
  if (ctx.precision() == Precision::mixed) p.tolerance = 3e-2;  // of rounded operands
  p.run = [&ctx, d] {
    ForwardOptions options;
    options.selection = &d->in.selection;
    d->model->forward(ctx, d->in.images, d->in.views, options);
  };
  p.others = [&ctx, name, seconds] { return pytorch_seconds(ctx, name, seconds); };
  p.error = [&ctx, d, name, tolerance = p.tolerance] {
    std::string worst;
    const double error = model_error(ctx, d->in, *d->model, &worst);
    if (!(error <= tolerance))
      fail(Status::internal, "bench model/{}: {} is off by {:.2g} of the largest value, at most {:.2g} expected", name,
           worst, error, tolerance);
    return error;
  };
  return p;
}

}  // namespace

std::vector<Case> model_cases(const Options& options) {
  std::vector<Case> cases;
  for (const char* name : {"tiny", "small", "paper"})
    cases.push_back({name, [name = std::string(name), seconds = options.seconds](Context& ctx) {
                       return prepare_model(ctx, name, seconds);
                     }});
  return cases;
}

}  // namespace vsplat::bench

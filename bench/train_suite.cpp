// One training step of the size "small": the network's part alone, and the whole of it.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "bench/bench.h"
#include "bench/case_data.h"
#include "bench/scenes.h"
#include "model/io/archive/selection_file.h"
#include "model/networks/params/init.h"
#include "model/networks/params/model_file.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "model/render/render.h"
#include "model/train/trainer.h"
#include "model/views/orbit.h"
#include "model/views/placement.h"
#include "model/views/views.h"
#include "runtime/fail.h"

namespace vsplat::bench {

namespace {

constexpr int kInputs = 4, kViews = 8;

// What a step is given. Four input views, those of a file or of a drawn scene; four more about the object; a drawn
// scene's pictures where no others are there.
struct Data {
  Config config;
  Weights weights;
  std::vector<int> selection;
  std::vector<float> noise;  // on the logits
  TrainingViews views;
};

std::vector<Camera> read_inputs(const std::string& path, const Config& config, std::vector<float>& pictures) {
  std::vector<Camera> out;
  const ViewSet set = read_views(path);
  if (set.views.size() != kInputs) fail(Status::input, "{}: {} views, {} expected", path, set.views.size(), kInputs);
  for (const ListedView& view : set.views) {
    Framing framing;
    framing.size = config.image;
    const PreparedView prepared = prepare_view(view.camera, view.picture.string(), "", framing);
    pictures.insert(pictures.end(), prepared.image.data.begin(), prepared.image.data.end());
    out.push_back(prepared.camera);
  }
  return out;
}

std::shared_ptr<Data> make_data(Context& ctx, const Options& options) {
  auto d = std::make_shared<Data>();
  if (options.model.empty()) {
    d->config = named_config("small");
    d->weights = initial_weights(d->config, 1);
  } else {
    ModelFile file = load_model(options.model);
    d->config = file.config;
    d->weights = std::move(file.weights);
  }
  d->selection = options.selection.empty() ? shell(d->config.volume, static_cast<std::size_t>(d->config.voxels()) / 10)
                                           : read_selection(options.selection, d->config.voxels());
  d->noise = random_floats(d->config.voxels(), 99);

  std::vector<float> pictures;
  std::vector<Camera> cameras;
  const BenchScene scene = make_scene("small-5k");
  if (options.cameras.empty())
    cameras = orbit_about(scene.cameras, Eigen::Vector3d::Zero(), kInputs, d->config.image, d->config.image);
  else
    cameras = read_inputs(options.cameras, d->config, pictures);
  OrbitOptions above;
  above.elevation_deg = 35;
  for (const Camera& c :
       orbit_about(cameras, Eigen::Vector3d::Zero(), kViews - kInputs, d->config.image, d->config.image, above))
    cameras.push_back(c);
  const DeviceGaussians drawn = upload(ctx, scene.scene.gaussians);
  for (std::size_t v = pictures.empty() ? 0 : kInputs; v < cameras.size(); ++v) {
    const Picture picture = render_picture(ctx, drawn, cameras[v], {});
    pictures.insert(pictures.end(), picture.colour.data.begin(), picture.colour.data.end());
  }
  for (float& value : pictures) value = std::clamp(value, 0.0f, 1.0f);
  d->views.object = "bench";
  d->views.pictures = std::move(pictures);
  d->views.cameras = place_views(cameras, {}, d->config.rebase).cameras;
  d->views.inputs = kInputs;
  return d;
}

// In mixed precision, a function of rounded weights does not change over the short steps of slope_error().
bool has_slope(const Context& ctx) { return ctx.precision() == Precision::fp32; }

// How far the change of a function along its gradient by `weights` is from what the gradient says, relative to that.
// value() is of the weights as they are on the device.
template <class Value>
double slope_error(Context& ctx, const LearntWeights& weights, double step, const Value& value) {
  std::map<std::string, std::vector<float>> gradients, values;
  double square = 0;
  for (const std::string& name : weights.names()) {
    const LearntTensor& t = weights.at(name);
    if (!t.gradient) continue;
    values[name] = ctx.read<float>(t.value);
    gradients[name] = ctx.read<float>(t.gradient);
    for (const float g : gradients[name]) square += static_cast<double>(g) * static_cast<double>(g);
  }
  const double norm = std::sqrt(square);
  if (!(norm > 0)) return INFINITY;
  const auto at = [&](double along) {
    for (const auto& [name, from] : values) {
      std::vector<float> moved = from;
      for (std::size_t i = 0; i < moved.size(); ++i)
        moved[i] += static_cast<float>(along / norm * static_cast<double>(gradients[name][i]));
      ctx.write(weights.at(name).value, moved.data());
    }
    return value();
  };
  const double slope = (at(step) - at(-step)) / (2 * step);
  at(0);
  return std::abs(slope - norm) / norm;
}

// Forward, and backward from a gradient by every number of both levels' Gaussians.
struct Network {
  std::shared_ptr<Data> data;
  LearntWeights weights;
  VsplatModel model;
  Tensor pictures;
  DeviceCameras cameras;
  std::array<std::vector<Tensor>, 2> by;  // coarse, final: means, scales, quaternions, opacities, harmonics

  Network(Context& ctx, std::shared_ptr<Data> given)
      : data(std::move(given)), weights(ctx, data->config, data->weights), model(ctx, data->config, weights) {
    const long s = data->config.image;
    pictures = ctx.upload({kInputs, s, s, 3}, data->views.pictures.data());
    cameras = upload_cameras(ctx, {data->views.cameras.begin(), data->views.cameras.begin() + kInputs});
    const VsplatModel::Trained trained = forward(ctx, model);
    std::uint32_t seed = 0;
    for (std::size_t level : {0, 1})
      for (const Tensor& t : parts(level ? trained.final : trained.coarse))
        by[level].push_back(ctx.upload(t.shape(), random_floats(t.count(), ++seed, -1.7e-3f, 1.7e-3f)));
  }

  static std::vector<Tensor> parts(const DeviceGaussians& g) { return {g.means, g.scales, g.quats, g.opacities, g.sh}; }

  VsplatModel::Trained forward(Context& ctx, const VsplatModel& of) const {
    ForwardOptions options;
    options.temperature = 1;
    options.selection = &data->selection;
    return of.fine_in_training(ctx, of.coarse_in_training(ctx, pictures, cameras, options, false), options);
  }

  GaussianGradients gradient(Context& ctx, std::size_t level) const {
    std::vector<Tensor> out;  // copies: backward uses them up
    for (const Tensor& t : by.at(level)) {
      out.push_back(ctx.tensor(t.shape()));
      ctx.copy(t, out.back());
    }
    return {out[0], out[1], out[2], out[3], out[4]};
  }

  void run(Context& ctx) const {
    VsplatModel::Trained trained = forward(ctx, model);
    model.backward(ctx, trained, gradient(ctx, 0), gradient(ctx, 1));
  }

  // The function whose gradient it is, of the weights as they are.
  double value(Context& ctx) const {
    const VsplatModel now(ctx, data->config, weights);
    const VsplatModel::Trained trained = forward(ctx, now);
    double sum = 0;
    for (std::size_t level : {0, 1}) {
      const std::vector<Tensor> of = parts(level ? trained.final : trained.coarse);
      for (std::size_t p = 0; p < of.size(); ++p) {
        const auto values = ctx.read<float>(of[p]), factors = ctx.read<float>(by.at(level).at(p));
        for (std::size_t i = 0; i < values.size(); ++i)
          sum += static_cast<double>(values[i]) * static_cast<double>(factors[i]);
      }
    }
    return sum;
  }
};

Prepared prepare_network(Context& ctx, const Options& options) {
  const auto n = std::make_shared<Network>(ctx, make_data(ctx, options));
  Prepared p;
  p.kind = Kind::training;
  p.run = [&ctx, n] { n->run(ctx); };
  if (has_slope(ctx))
    p.error = [&ctx, n] {
      n->weights.zero_gradients(ctx);
      n->run(ctx);
      return slope_error(ctx, n->weights, 1e-4, [&] { return n->value(ctx); });
    };
  p.tolerance = 1e-2;
  return p;
}

// Both levels drawn in every view, the loss, and the optimiser too.
struct Step {
  std::shared_ptr<Data> data;
  Trainer trainer;

  Step(Context& ctx, const std::shared_ptr<Data>& given)
      : data(given), trainer(ctx, start(*given), given->config.voxels() / 4) {}
  static Checkpoint start(const Data& data) {
    Checkpoint out;
    out.config.model = data.config;
    out.config.schedule.lr = 0;  // every step sees the same model
    out.parameters = data.weights;
    return out;
  }
  StepReport run() {
    StepItem item;
    item.views = &data->views;
    item.selection = &data->selection;
    item.noise = &data->noise;
    return trainer.step({item});
  }
};

Prepared prepare_step(Context& ctx, const Options& options) {
  const auto s = std::make_shared<Step>(ctx, make_data(ctx, options));
  Prepared p;
  p.kind = Kind::training;
  p.run = [s] { s->run(); };
  if (has_slope(ctx))
    p.error = [&ctx, s] {
      s->run();
      return slope_error(ctx, s->trainer.weights(), 3e-4, [&] { return s->run().loss; });
    };
  p.tolerance = 5e-2;  // pixels flip where alpha meets 1/255
  return p;
}

}  // namespace

std::vector<Case> train_cases(const Options& options) {
  return {{"small network", [options](Context& ctx) { return prepare_network(ctx, options); }},
          {"small step", [options](Context& ctx) { return prepare_step(ctx, options); }}};
}

}  // namespace vsplat::bench

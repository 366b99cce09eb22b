#include "model/fit/fitter.h"

#include <algorithm>
#include <cmath>

#include "model/base/rng.h"
#include "model/base/scene_edit.h"
#include "model/fit/screen_size.h"
#include "model/ops/fit/exposure.h"
#include "model/ops/fit/picture_target.h"
#include "model/ops/fit/splat_adam.h"
#include "model/ops/fit/splat_filter.h"
#include "model/ops/fit/splat_split.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

constexpr float kLeastLogit = -12, kMostLogit = 8;
constexpr long kFilterEvery = 100;  // steps after which the filter follows Gaussians that have moved

double logit(double p) {
  const double held = std::clamp(p, 1e-5, 1 - 1e-4);
  return std::log(held / (1 - held));
}

// Allocates `capacity` rows; rows beyond `values` are zeros.
Tensor with_capacity(Context& ctx, const std::vector<float>& values, Shape shape, long capacity, const char* what) {
  shape[0] = capacity;
  long count = 1;
  for (const long d : shape) count *= d;
  std::vector<float> data(values);
  data.resize(static_cast<std::size_t>(count), 0.0f);
  return ctx.upload(shape, data, Type::f32, what);
}

GaussianGradients first(const GaussianGradients& g, long n) {
  return {g.means.first(n), g.scales.first(n), g.quats.first(n), g.opacities.first(n), g.sh.first(n)};
}

SplatParameters zeros_like(Context& ctx, const SplatParameters& x) {
  const auto zeros = [&](const Tensor& t) {
    const Tensor out = ctx.tensor(t.shape(), Type::f32, "moments");
    ctx.fill_zero(out);
    return out;
  };
  return {zeros(x.means), zeros(x.log_scales), zeros(x.quats), zeros(x.logits), zeros(x.sh)};
}

// A picture of these colours that lets nothing through.
DevicePicture opaque(Context& ctx, const Tensor& colour) {
  const Shape shape{colour.dim(0), colour.dim(1)};
  return {colour, ctx.upload(shape, std::vector<float>(static_cast<std::size_t>(shape[0] * shape[1]), 1.0f)), {}};
}

SplatParameters parameters_of(Context& ctx, const Gaussians& g, const FitOptions& options, long capacity) {
  const auto n = static_cast<long>(g.count);
  std::vector<float> log_scales(g.scales.size()), logits(g.opacities.size());
  for (std::size_t i = 0; i < log_scales.size(); ++i)
    log_scales[i] = std::log(std::clamp(g.scales[i], options.low_scale, options.high_scale));
  for (std::size_t i = 0; i < logits.size(); ++i) logits[i] = static_cast<float>(logit(g.opacities[i]));
  const auto s = static_cast<long>(g.sh_count());
  return {with_capacity(ctx, g.means, {n, 3}, capacity, "means"),
          with_capacity(ctx, log_scales, {n, 3}, capacity, "log scales"),
          with_capacity(ctx, g.quats, {n, 4}, capacity, "quats"), with_capacity(ctx, logits, {n}, capacity, "logits"),
          with_capacity(ctx, g.sh, {n, s, 3}, capacity, "sh")};
}

}  // namespace

Fitter::Fitter(Context& ctx, const Gaussians& start, float near, const std::optional<std::array<float, 3>>& mirror,
               const FitOptions& options)
    : ctx_(ctx), options_(options), near_(near), mirror_(mirror), count_(static_cast<long>(start.count)) {
  const long capacity = std::max(options.max_gaussians, count_);
  all_.x = parameters_of(ctx, start, options, capacity);
  all_.m = zeros_like(ctx, all_.x);
  all_.v = zeros_like(ctx, all_.x);
  dall_ = zero_gradients(ctx, capacity, start.sh_degree);
  scales_ = ctx.tensor({capacity, 3}, Type::f32, "scales");
  opacities_ = ctx.tensor({capacity}, Type::f32, "opacities");
  if (options.pull > 0) {
    home_means_ = ctx.tensor({count_, 3}, Type::f32, "home");
    home_scales_ = ctx.tensor({count_, 3}, Type::f32, "home");
    ctx.copy(all_.x.means.first(count_), home_means_);
    ctx.copy(all_.x.log_scales.first(count_), home_scales_);
  }
  loss_ = ctx.tensor({3}, Type::f32, "loss");
  density_ = make_density(ctx, options.density, capacity);
  if (density_->scores()) {
    fresh_scores_ = ctx.tensor({capacity}, Type::f32, "scores of a picture");
    ctx.fill_zero(fresh_scores_);
  }
  if (options.background.kind == FitBackground::Kind::sky) sky_.emplace(ctx);
}

DeviceGaussians Fitter::activate(Context& c, const Dropping& dropping) const {
  const SplatParameters x = parameters();
  splat_parameters_forward(c, {x, dropping, scales_.first(count_), opacities_.first(count_)});
  if (variances_) splat_filter_forward(c, {variances_.first(count_), scales_.first(count_), opacities_.first(count_)});
  return {x.means, scales_.first(count_), x.quats, opacities_.first(count_), x.sh};
}

void Fitter::set_cameras(const std::vector<Camera>& cameras) {
  views_ = upload_views(ctx_, cameras, near_, {});
  variances_ = ctx_.tensor({all_.x.count()}, Type::f32, "filter variances");
  find_variances();
  if (ctx_.planning()) return;
  const SplatParameters x = parameters();
  const auto variances = ctx_.read<float>(variances_.first(count_));
  auto log_scales = ctx_.read<float>(x.log_scales), logits = ctx_.read<float>(x.logits);
  for (std::size_t k = 0; k < variances.size(); ++k) {
    double opacity = 1 / (1 + std::exp(-static_cast<double>(logits[k])));
    for (std::size_t i = 3 * k; i < 3 * k + 3; ++i) {
      const double given = std::exp(static_cast<double>(log_scales[i]));
      const double scale = std::sqrt(std::max(given * given - variances[k], given * given / 4));
      opacity *= std::sqrt(1 + variances[k] / (scale * scale));
      log_scales[i] = std::max(static_cast<float>(std::log(scale)), std::log(options_.low_scale));
    }
    logits[k] = static_cast<float>(logit(opacity));
  }
  ctx_.write(x.log_scales, log_scales.data());
  ctx_.write(x.logits, logits.data());
  if (home_scales_) ctx_.copy(x.log_scales, home_scales_);
}

void Fitter::find_variances() {
  if (variances_) splat_filter_variances(ctx_, {parameters().means, views_, variances_.first(count_)});
}

SplatParameters Fitter::parameters() const { return vsplat::first(all_, count_).x; }
GaussianGradients Fitter::gradient() const { return first(dall_, count_); }

RenderOptions Fitter::drawing(const std::array<float, 3>& background) const {
  RenderOptions out;
  out.background = background;
  out.near = near_;
  out.antialias = options_.antialias;
  out.mirror = mirror_;
  out.most_pairs = options_.most_pairs;
  return out;
}

std::function<bool(std::uint64_t)> Fitter::bound_on_screen(const Camera& camera, const Dropping& dropping) {
  return [this, &camera, dropping, bounded = false](std::uint64_t found) mutable {
    const std::uint64_t most = affordable_tiles(camera, count_);
    if (bounded || found <= most) return false;
    bounded = true;
    const Uncancelled unbroken(ctx_);
    const SplatParameters now = parameters();
    std::vector<float> log_scales = ctx_.read<float>(now.log_scales);
    shrink_on_screen({ctx_.read<float>(now.means), ctx_.read<float>(now.logits)}, camera, near_, most,
                     std::log(options_.low_scale), log_scales);
    ctx_.copy(ctx_.upload(now.log_scales.shape(), log_scales, Type::f32, "log scales"), now.log_scales);
    activate(ctx_, dropping);
    verbose("step {}: {} Gaussians touch {} tiles of a picture, at most {} are possible: the largest are made smaller",
            step_, count_, found, most);
    return true;
  };
}

void Fitter::step(const DeviceFitPicture& picture, const FitAside& aside) {
  differentiate(picture, aside);
  move();
}

void Fitter::differentiate(const DeviceFitPicture& picture, const FitAside& aside) {
  try {
    add_gradient(picture, aside);
  } catch (const Error&) {  // part of the gradient may have been written
    const Uncancelled whole(ctx_);
    for (const Tensor& t : {dall_.means, dall_.scales, dall_.quats, dall_.opacities, dall_.sh}) ctx_.fill_zero(t);
    throw;
  }
}

void Fitter::add_gradient(const DeviceFitPicture& picture, const FitAside& aside) {
  const auto now = static_cast<std::uint32_t>(step_);
  RenderOptions how = drawing(drawn_over(options_.background, picture.masked, options_.seed, now));
  const Tensor view = sky_ ? upload_views(ctx_, {picture.camera}, near_, mirror_) : Tensor();
  const float alpha_weight = picture.masked ? options_.alpha_weight : 0;
  const Dropping dropping{options_.drop, options_.seed, now};
  how.counted = bound_on_screen(picture.camera, dropping);
  how.repeated = &gradients_;
  const DeviceGaussians gaussians = activate(ctx_, dropping);
  Tensor scores;
  if (scores_count()) {
    scores = fresh_scores_.first(count_);
    ctx_.fill_zero(scores);
  }
  const auto loss = [&](Context& c, const DevicePicture& drawn) {
    const long h = picture.camera.height, w = picture.camera.width;
    const Tensor target = c.tensor({h, w, 3}, Type::f32, "target");
    PictureGradient by{c.tensor({h, w, 3}, Type::f32, "loss by the picture"), {}, {}};
    const bool by_depth = options_.depth_weight > 0 && picture.depth;
    if (alpha_weight > 0 || sky_ || by_depth) by.alpha = c.tensor({h, w}, Type::f32, "loss by alpha");
    DevicePicture shown = drawn;
    if (sky_) shown.colour = sky_->shown(c, drawn, view);
    // The exposure is also the sky's, but not that of a background which no camera saw.
    const DevicePicture whole = sky_ && aside.exposure ? opaque(c, shown.colour) : drawn;
    if (aside.exposure) {
      shown.colour = c.tensor({h, w, 3}, Type::f32, "exposed picture");
      exposure_forward(c, {aside.exposure, whole, how.background, shown.colour});
    }
    picture_target(c, {picture.given, picture.known, how.background, shown, alpha_weight, target, by.alpha});
    const Shape one{1, h, w, 3};
    PictureLoss a{shown.colour.reshaped(one), target.reshaped(one), options_.ssim_weight, loss_,
                  by.colour.reshaped(one)};
    a.error = ErrorKind::absolute;
    a.similarity =
        options_.ssim_weight > 0 && std::min(h, w) > 10 ? SimilarityKind::single_scale : SimilarityKind::none;
    picture_loss(c, a);
    const PictureGradient exposed{by.colour, sky_ ? Tensor() : by.alpha, {}};
    if (aside.exposure) exposure_backward(c, {aside.exposure, whole, how.background, exposed, aside.dexposure});
    if (sky_) sky_->differentiate(c, drawn, view, by);
    if (by_depth) {
      by.depth = c.tensor({h, w}, Type::f32, "loss by depth");
      depth_loss(c, {drawn, picture.depth, options_.depth_kind, options_.depth_weight, picture.known_depths, by.depth,
                     by.alpha});
    }
    if (scores) {
      by.depth = c.tensor({h, w}, Type::f32, "error");
      splat_error(c, shown.colour, target, by.depth);
    }
    return by;
  };
  render_with_backward(ctx_, gaussians, picture.camera, how, loss, {gradient()}, aside.dpose, {scores, true});
  const auto share = [&](float weight) { return weight / static_cast<float>(std::max(count_, 1L)); };
  SplatParametersBackward back{parameters(), dropping, gradient()};
  back.opacity_weight = share(options_.opacity_weight);
  back.scale_weight = share(options_.scale_weight);
  if (home_means_ && home_means_.dim(0) == count_) {
    back.pull = share(options_.pull);
    back.home_means = home_means_;
    back.home_scales = home_scales_;
  }
  if (variances_)
    splat_filter_backward(ctx_, {variances_.first(count_), back.x.log_scales, gaussians.opacities,
                                 back.dgaussians.scales, back.dgaussians.opacities});
  splat_parameters_backward(ctx_, back);
}

// Whether a round of growth that uses scores is still to come.
bool Fitter::scores_count() const {
  if (!fresh_scores_ || options_.grow_every <= 0 || replaced_after_ > 0) return false;
  return (step_ / options_.grow_every + 1) * options_.grow_every < options_.grow_until;
}

void Fitter::move() {
  const Uncancelled whole(ctx_);
  if (scores_count()) add_scores(ctx_, fresh_scores_.first(count_), density_->scores().first(count_));
  ++step_;
  const SplatState now = vsplat::first(all_, count_);
  const GaussianGradients d = gradient();
  const bool shape = step_ > options_.colours_first;
  const double done = std::min(1.0, static_cast<double>(step_) / static_cast<double>(options_.steps));
  const double means = shape ? options_.rates.means * std::pow(options_.means_fall, done) : 0;
  const double colours = std::pow(options_.sh_fall, done);
  const auto adam = [&](const Tensor& x, const Tensor& g, const Tensor& m, const Tensor& v, double rate, float low,
                        float high, long head, double rest) {
    SplatAdam a{x, g, m, v, step_ - replaced_after_, rate, head, rest};
    a.low = low;
    a.high = high;
    a.sparse = true;
    splat_adam(ctx_, a);
  };
  constexpr float any = std::numeric_limits<float>::infinity();
  adam(now.x.means, d.means, now.m.means, now.v.means, means, -any, any, 0, 0);
  adam(now.x.log_scales, d.scales, now.m.log_scales, now.v.log_scales, shape ? options_.rates.log_scales : 0,
       std::log(options_.low_scale), std::log(options_.high_scale), 0, 0);
  adam(now.x.quats, d.quats, now.m.quats, now.v.quats, shape ? options_.rates.quats : 0, -any, any, 0, 0);
  adam(now.x.logits, d.opacities, now.m.logits, now.v.logits, options_.rates.logits, kLeastLogit, kMostLogit, 0, 0);
  adam(now.x.sh, d.sh, now.m.sh, now.v.sh, colours * options_.rates.sh, -any, any, 3, colours * options_.rates.sh_rest);
  if (sky_) sky_->move(ctx_, step_);
  if (options_.noise > 0 && shape)
    splat_noise(ctx_, {now.x, options_.noise * static_cast<float>(means), options_.seed,
                       static_cast<std::uint32_t>(step_ - 1)});
  const bool grows = options_.grow_every > 0 && replaced_after_ == 0 && step_ % options_.grow_every == 0 &&
                     step_ < options_.grow_until;
  if (grows) grow();
  if (grows || step_ % kFilterEvery == 0) find_variances();
}

void Fitter::grow() {
  const long capacity = all_.x.count();
  const long more = static_cast<long>(std::floor(options_.growth * static_cast<double>(count_)));
  const long wanted = std::max(std::min(more, capacity), count_);
  count_ = density_->grow(ctx_, {all_, count_, wanted, options_.seed, static_cast<std::uint32_t>(step_)});
}

namespace {

Tensor compare(Context& ctx, const DevicePicture& drawn, const std::array<float, 3>& background,
               const DeviceFitPicture& picture) {
  const long h = picture.camera.height, w = picture.camera.width;
  const Tensor target = ctx.tensor({h, w, 3}, Type::f32, "target"), out = ctx.tensor({3}, Type::f32, "score");
  picture_target(ctx, {picture.given, picture.known, background, drawn, 0, target, {}});
  const Shape one{1, h, w, 3};
  PictureLoss a{drawn.colour.reshaped(one), target.reshaped(one), 1, out, {}};
  a.similarity = std::min(h, w) > 10 ? SimilarityKind::single_scale : SimilarityKind::none;
  picture_loss(ctx, a);
  return out;
}

// Unknown pixels have no error, and windows without a known pixel are similar: what differs lies in the others.
FitScore score_of(Context& ctx, const Tensor& measured, const DeviceFitPicture& picture) {
  const auto values = ctx.read<float>(measured);
  const double share = std::max(picture.known_share, 1e-12), windows = std::max(picture.window_share, 1e-12);
  const auto error = static_cast<double>(values[1]), similarity = static_cast<double>(values[2]);
  return {-10 * std::log10(std::max(error / share, 1e-12)), windows < 1 ? 1 - (1 - similarity) / windows : similarity};
}

}  // namespace

Tensor Fitter::measure(const DeviceFitPicture& picture) {
  const std::array<float, 3> background = measured_over(options_.background);
  RenderOptions how = drawing(background);
  how.counted = bound_on_screen(picture.camera, {});
  DevicePicture drawn = render(ctx_, activate(ctx_, {}), picture.camera, how);
  if (sky_) drawn.colour = sky_->shown(ctx_, drawn, upload_views(ctx_, {picture.camera}, near_, mirror_));
  return compare(ctx_, drawn, background, picture);
}

FitScore Fitter::score(const DeviceFitPicture& picture) { return score_of(ctx_, measure(picture), picture); }

FitScore Fitter::score(const Gaussians& scene, const DeviceFitPicture& picture) {
  const std::array<float, 3> background = measured_over(options_.background);
  const double pixels = static_cast<double>(picture.camera.width) * picture.camera.height;
  const DevicePicture drawn = render(ctx_, place_on_device(ctx_, scene, pixels), picture.camera, drawing(background));
  return score_of(ctx_, compare(ctx_, drawn, background, picture), picture);
}

namespace {

// All parameters and their moments, by name.
template <class F>
void for_each_tensor(const SplatState& state, const F& use) {
  for (const auto& [of, x] : {std::pair("x", &state.x), std::pair("m", &state.m), std::pair("v", &state.v)}) {
    const auto name = [of = of](const char* kind) { return std::string(of) + "." + kind; };
    use(name("means"), x->means);
    use(name("log_scales"), x->log_scales);
    use(name("quats"), x->quats);
    use(name("logits"), x->logits);
    use(name("sh"), x->sh);
  }
}

}  // namespace

void Fitter::add_weights(const Camera& camera, const Tensor& sums) {
  RenderOptions how = drawing({0, 0, 0});
  how.counted = bound_on_screen(camera, {});
  const auto ones = [&](Context& c, const DevicePicture& drawn) {
    PictureGradient by;
    by.depth = c.upload(drawn.alpha.shape(), std::vector<float>(static_cast<std::size_t>(drawn.alpha.count()), 1.0f),
                        Type::f32, "ones");
    return by;
  };
  // The gradient stays zero: the picture's is.
  render_with_backward(ctx_, activate(ctx_, {}), camera, how, ones, {gradient()}, nullptr, {sums});
}

void Fitter::replace(const Gaussians& gaussians) {
  const Uncancelled whole(ctx_);
  count_ = static_cast<long>(gaussians.count);
  replaced_after_ = step_;
  views_ = variances_ = {};  // the Gaussians are filtered already
  const SplatState now = vsplat::first(all_, count_);
  const SplatParameters from = parameters_of(ctx_, gaussians, options_, count_);
  for (const auto& [x, m, v, f] : {std::tuple{now.x.means, now.m.means, now.v.means, from.means},
                                   {now.x.log_scales, now.m.log_scales, now.v.log_scales, from.log_scales},
                                   {now.x.quats, now.m.quats, now.v.quats, from.quats},
                                   {now.x.logits, now.m.logits, now.v.logits, from.logits},
                                   {now.x.sh, now.m.sh, now.v.sh, from.sh}}) {
    ctx_.copy(f, x);
    ctx_.fill_zero(m);
    ctx_.fill_zero(v);
  }
}

FitTensors Fitter::state() const {
  FitTensors out;
  for_each_tensor(vsplat::first(all_, count_), [&](const std::string& name, const Tensor& t) {
    out[name] = {t.shape(), ctx_.read<float>(t)};
  });
  if (variances_) out["filter.variances"] = {{count_}, ctx_.read<float>(variances_.first(count_))};
  if (const Tensor scores = density_->scores()) out["scores"] = {{count_}, ctx_.read<float>(scores.first(count_))};
  if (sky_) sky_->put(ctx_, out);
  return out;
}

void Fitter::restore(const FitTensors& state, long steps_done, long replaced_after) {
  const std::string first_name = "x.logits";  // a named variable: GCC 14 warns of a dangling reference to a temporary
  if (replaced_after > 0) views_ = variances_ = {};
  const FitTensor& logits = tensor_of(state, first_name);
  if (logits.shape.size() != 1 || logits.shape[0] < 0 || logits.shape[0] > all_.x.count())
    fail(Status::format, "a fit's state has {} for x.logits, at most [{}] expected", text_of(logits.shape),
         all_.x.count());
  count_ = logits.shape[0];
  const auto read = [&](const std::string& name, const Tensor& t) {
    const FitTensor& from = tensor_of(state, name);
    if (from.shape != t.shape())
      fail(Status::format, "a fit's state has {} for {}, {} expected", text_of(from.shape), name, text_of(t.shape()));
    ctx_.write(t, from.data.data());
  };
  for_each_tensor(vsplat::first(all_, count_), read);
  if (variances_) read("filter.variances", variances_.first(count_));
  if (const Tensor scores = density_->scores()) read("scores", scores.first(count_));
  if (sky_) sky_->get(ctx_, state);
  step_ = steps_done;
  replaced_after_ = replaced_after;
}

Gaussians Fitter::foreground() {
  Gaussians g = download(ctx_, activate(ctx_, {}));
  Gaussians out;
  out.sh_degree = g.sh_degree;
  const std::size_t s = 3 * g.sh_count();
  for (std::size_t k = 0; k < g.count; ++k) {
    const float* q = &g.quats[4 * k];
    const float length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const auto finite = [](const float* values, std::size_t count) {
      return std::all_of(values, values + count, [](float v) { return std::isfinite(v); });
    };
    if (!(g.opacities[k] >= 1.0f / 255 && length > 0 && std::isfinite(length) && finite(&g.means[3 * k], 3) &&
          finite(&g.scales[3 * k], 3) && finite(&g.sh[s * k], s)))
      continue;
    out.means.insert(out.means.end(), &g.means[3 * k], &g.means[3 * k] + 3);
    out.scales.insert(out.scales.end(), &g.scales[3 * k], &g.scales[3 * k] + 3);
    for (int i = 0; i < 4; ++i) out.quats.push_back(q[i] / length);
    out.opacities.push_back(g.opacities[k]);
    out.sh.insert(out.sh.end(), &g.sh[s * k], &g.sh[s * k] + s);
    ++out.count;
  }
  return out;
}

Gaussians Fitter::gaussians() {
  Gaussians out = foreground();
  if (sky_) append(out, sky_->gaussians(ctx_, options_.sky, out.sh_degree));
  return out;
}

}  // namespace vsplat

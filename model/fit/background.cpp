#include "model/fit/background.h"

#include <algorithm>
#include <cmath>

#include "model/base/rng.h"
#include "model/base/scene.h"
#include "model/ops/fit/sky_background.h"
#include "model/ops/fit/splat_adam.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"

namespace vsplat {
namespace {

constexpr double kSkyRate = 2.5e-3,
                 kSkyRestRate = 5e-4;  // Adam learning rates: the mean colour, the other coefficients
// A pixel ends before the Gaussian that would bring its transmittance T under 1e-4 (rasterize.cl), so T (1 - opacity)
// < 1e-4 there: at most a thousandth of what is behind shines through.
constexpr float kSkyOpacity = 0.9f;

}  // namespace

std::array<float, 3> measured_over(const FitBackground& background) {
  using Kind = FitBackground::Kind;
  if (background.kind == Kind::automatic) return {1, 1, 1};
  if (background.kind == Kind::colour) return background.colour;
  return {0, 0, 0};
}

std::array<float, 3> drawn_over(const FitBackground& background, bool masked, std::uint64_t seed, std::uint32_t step) {
  using Kind = FitBackground::Kind;
  std::array<float, 3> out = measured_over(background);
  const bool now = background.kind == Kind::automatic && masked && step % 2 == 1;
  if (!now && background.kind != Kind::random) return out;
  const auto random = philox4x32_10({0, step, stream_of("fit.background"), 0}, rng_key(seed));
  for (std::size_t c = 0; c < 3; ++c) out[c] = uniform01(random[c]);
  return out;
}

Sky::Sky(Context& ctx) {
  for (Tensor* t : {&sh_, &gradient_, &m_, &v_}) {
    *t = ctx.tensor({1, 3 * kSkyBasis}, Type::f32, "sky");
    ctx.fill_zero(*t);
  }
}

Tensor Sky::shown(Context& ctx, const DevicePicture& drawn, const Tensor& camera) const {
  const Tensor out = ctx.tensor(drawn.colour.shape(), Type::f32, "picture over the sky");
  sky_background_forward(ctx, {sh_.reshaped({kSkyBasis, 3}), camera, drawn, out});
  return out;
}

void Sky::differentiate(Context& ctx, const DevicePicture& drawn, const Tensor& camera,
                        const PictureGradient& by) const {
  sky_background_backward(ctx, {sh_.reshaped({kSkyBasis, 3}), camera, drawn, by, gradient_.reshaped({kSkyBasis, 3})});
}

void Sky::move(Context& ctx, long step) const {
  SplatAdam a{sh_, gradient_, m_, v_, step, kSkyRate, 3, kSkyRestRate};
  splat_adam(ctx, a);
}

Gaussians Sky::gaussians(Context& ctx, const SkySphere& sphere, int sh_degree) const {
  const std::vector<float> sh = ctx.read<float>(sh_);
  Gaussians out;
  out.count = static_cast<std::size_t>(kSkyGaussians);
  out.sh_degree = sh_degree;
  out.opacities.assign(out.count, kSkyOpacity);
  out.sh.assign(3 * out.count * out.sh_count(), 0.0f);
  // A standard deviation is the distance of neighbours on the spiral, so that several overlap everywhere.
  const auto n = static_cast<double>(kSkyGaussians);
  out.scales.assign(3 * out.count, static_cast<float>(sphere.radius * std::sqrt(4 * M_PI / n)));
  for (std::size_t i = 0; i < out.count; ++i) {
    const double z = 1 - (2 * static_cast<double>(i) + 1) / n, r = std::sqrt(1 - z * z);
    const double turn = 2.399963229728653 * static_cast<double>(i);
    const Eigen::Vector3d d(r * std::cos(turn), r * std::sin(turn), z);
    const Eigen::VectorXd basis = sh_basis(4, d);
    for (std::size_t c = 0; c < 3; ++c) {
      double colour = 0.5;
      for (std::size_t k = 0; k < static_cast<std::size_t>(kSkyBasis); ++k)
        colour += basis[static_cast<Eigen::Index>(k)] * static_cast<double>(sh[3 * k + c]);
      out.means.push_back(static_cast<float>(sphere.centre[c] + sphere.radius * d[static_cast<Eigen::Index>(c)]));
      out.sh[3 * out.sh_count() * i + c] = static_cast<float>((std::clamp(colour, 0.0, 1.0) - 0.5) / kShC0);
    }
    for (const float q : {1.0f, 0.0f, 0.0f, 0.0f}) out.quats.push_back(q);
  }
  return out;
}

void Sky::put(Context& ctx, FitTensors& out) const {
  for (const auto& [name, t] : {std::pair("sky.x", &sh_), std::pair("sky.m", &m_), std::pair("sky.v", &v_)})
    out[name] = {t->shape(), ctx.read<float>(*t)};
}

void Sky::get(Context& ctx, const FitTensors& from) const {
  const std::pair<std::string, const Tensor*> tensors[] = {{"sky.x", &sh_}, {"sky.m", &m_}, {"sky.v", &v_}};
  for (const auto& [name, t] : tensors) {
    const FitTensor& kept = tensor_of(from, name);
    if (kept.shape != t->shape())
      fail(Status::format, "a fit's state has {} for {}, {} expected", text_of(kept.shape), name, text_of(t->shape()));
    ctx.write(*t, kept.data.data());
  }
}

}  // namespace vsplat

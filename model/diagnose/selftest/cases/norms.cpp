// LayerNorm, GroupNorm, and scales of layers.
#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/groupnorm.h"
#include "model/diagnose/selftest/reference/layer_scale.h"
#include "model/diagnose/selftest/reference/layernorm.h"
#include "model/ops/dense/groupnorm.h"
#include "model/ops/dense/layer_scale.h"
#include "model/ops/dense/layernorm.h"

namespace vsplat::selftest {
namespace {

std::size_t norm_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }

std::vector<double> plus(std::vector<double> a, const std::vector<float>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
  return a;
}

void layernorm_of(Checks& c, long rows, long channels) {
  const std::size_t n = norm_size(channels);
  const auto x = random_floats(norm_size(rows, channels), static_cast<std::uint32_t>(channels), -2, 3);
  const auto gamma = random_floats(n, 5, 0.5f, 1.5f), beta = random_floats(n, 4), dy = random_floats(x.size(), 6);
  const Tensor in = c.up({rows, channels}, x), out = c.gap({rows, channels});
  layernorm_forward(c.ctx, {in, c.up({channels}, gamma), c.up({channels}, beta), 1e-6f, out});
  c.close("forward", out, ref::layernorm(x, n, gamma, beta, 1e-6), 1e-5);
  const auto want = ref::layernorm_backward(x, n, gamma, 1e-6, as_doubles(dy));
  const auto before = random_floats(x.size(), 7), some = random_floats(n, 8);
  for (const bool add : {false, true}) {
    const LayerNormBackward a{in,
                              c.up({channels}, gamma),
                              1e-6f,
                              c.up({rows, channels}, dy),
                              add ? c.up({rows, channels}, before) : c.gap({rows, channels}),
                              c.up({channels}, some),
                              c.up({channels}, some),
                              add};
    layernorm_backward(c.ctx, a);
    c.close("backward, dx", a.dx, add ? plus(want.x, before) : want.x, 1e-5);
    c.close("backward, dgamma", a.dgamma, plus(want.gamma, some), 1e-5);
    c.close("backward, dbeta", a.dbeta, plus(want.beta, some), 1e-5);
  }
}

void modulation_of(Checks& c, long v, long p, long channels) {
  const std::size_t n = norm_size(channels), kept = norm_size(v, p), run = norm_size(p);
  const auto x = random_floats(norm_size(v * (1 + p), channels), 9, -2, 2), film = random_floats(kept * 2 * n, 10),
             gamma = random_floats(n, 11, 0.5f, 1.5f), beta = random_floats(n, 12), dy = random_floats(kept * n, 13);
  const auto normed = ref::layernorm(x, n, gamma, beta, 1e-6);
  std::vector<double> y, by_normed(x.size()), by_film(film.size());
  for (std::size_t row = 0; row < kept; ++row) {
    const std::size_t from = (row / run * (1 + run) + row % run + 1) * n;
    for (std::size_t i = 0; i < n; ++i) {
      const double shift = film[row * 2 * n + i], scale = film[row * 2 * n + n + i];
      y.push_back(normed[from + i] * (1 + scale) + shift);
      by_normed[from + i] = dy[row * n + i] * (1 + scale);
      by_film[row * 2 * n + i] = dy[row * n + i];
      by_film[row * 2 * n + n + i] = dy[row * n + i] * normed[from + i];
    }
  }
  const Tensor in = c.up({v, 1 + p, channels}, x), g = c.up({channels}, gamma), b = c.up({channels}, beta),
               f = c.up({v, p, 2 * channels}, film), out = c.gap({v, p, channels});
  modulate_forward(c.ctx, {in, g, b, f, 1e-6f, out});
  c.close("modulation", out, y, 1e-5);
  const auto want = ref::layernorm_backward(x, n, gamma, 1e-6, by_normed);
  const auto some = random_floats(n, 8);
  const ModulateBackward a{in,
                           g,
                           b,
                           f,
                           1e-6f,
                           c.up({v, p, channels}, dy),
                           c.gap({v, 1 + p, channels}),
                           c.gap({v, p, 2 * channels}),
                           c.up({channels}, some),
                           c.up({channels}, some),
                           false};
  modulate_backward(c.ctx, a);
  c.close("modulation, dx", a.dx, want.x, 1e-5);
  c.close("modulation, dfilm", a.dfilm, by_film, 1e-5);
  c.close("modulation, dgamma", a.dgamma, plus(want.gamma, some), 1e-5);
  c.close("modulation, dbeta", a.dbeta, plus(want.beta, some), 1e-5);
}

void layernorm_all(Checks& c) {
  for (const auto& [rows, channels] :
       c.some({std::array<long, 2>{1, 3}, {3, 7}, {63, 15}, {64, 16}, {65, 17}, {3, 65}, {7, 384}, {4099, 5}}))
    layernorm_of(c, rows, channels);
  modulation_of(c, 1, 1, 6);
  modulation_of(c, 3, 35, 37);
}

void groupnorm_of(Checks& c, long n, long c0, long c1, int groups) {
  const std::size_t channels = norm_size(c0 + c1), rows = norm_size(n), first = norm_size(c0);
  const auto x = random_floats(rows * channels, 3, -2, 3), dy = random_floats(rows * channels, 4),
             gamma = random_floats(channels, 5, 0.5f, 1.5f), beta = random_floats(channels, 6),
             before = random_floats(channels, 7);
  const auto part = [&](const auto& of, bool second) {
    auto out = of;
    out.clear();
    for (std::size_t i = 0; i < of.size(); ++i)
      if ((i % channels >= first) == second) out.push_back(of[i]);
    return out;
  };
  GroupNormForward f;
  const long ch = c0 + c1;
  f.x0 = c.up({n, c0}, part(x, false));
  if (c1 > 0) f.x1 = c.up({n, c1}, part(x, true));
  f.gamma = c.up({ch}, gamma), f.beta = c.up({ch}, beta), f.groups = groups;
  f.scale = c.gap({ch}), f.shift = c.gap({ch}), f.mean = c.gap({ch}), f.rstd = c.gap({ch});
  groupnorm_forward(c.ctx, f);
  const auto scale = c.ctx.read<float>(f.scale), shift = c.ctx.read<float>(f.shift);
  std::vector<float> y;
  for (std::size_t i = 0; i < x.size(); ++i) y.push_back(x[i] * scale[i % channels] + shift[i % channels]);
  c.close("forward", y, ref::groupnorm(x, rows, channels, static_cast<std::size_t>(groups), gamma, beta, 1e-6), 1e-5);
  c.keep();  // means and deviations
  const auto want = ref::groupnorm_backward(x, rows, channels, static_cast<std::size_t>(groups), gamma, beta, 1e-6, dy);
  GroupNormBackward b;
  b.x0 = f.x0, b.x1 = f.x1, b.gamma = f.gamma, b.groups = groups;
  b.scale = f.scale, b.shift = f.shift, b.mean = f.mean, b.rstd = f.rstd;
  b.dy = c.up({n, ch}, dy), b.dx0 = c.gap({n, c0});
  if (c1 > 0) b.dx1 = c.gap({n, c1});
  b.dgamma = c.up({ch}, before), b.dbeta = c.up({ch}, before);
  groupnorm_backward(c.ctx, b);
  c.close("backward, dx0", b.dx0, part(want.dx, false), 2e-5);
  if (c1 > 0) c.close("backward, dx1", b.dx1, part(want.dx, true), 2e-5);
  c.close("backward, dgamma", b.dgamma, plus(want.dgamma, before), 2e-5);
  c.close("backward, dbeta", b.dbeta, plus(want.dbeta, before), 2e-5);
}

void groupnorm_all(Checks& c) {
  struct Try {
    long n, c0, c1;
    int groups;
  };
  for (const Try& t : c.some({Try{3, 4, 0, 2},
                              {7, 3, 3, 2},
                              {63, 16, 0, 4},
                              {64, 20, 40, 4},
                              {65, 23, 1, 3},
                              {101, 33, 0, 1},
                              {1025, 12, 0, 6},
                              {4099, 5, 3, 2}}))
    groupnorm_of(c, t.n, t.c0, t.c1, t.groups);
}

void layer_scale_all(Checks& c) {
  for (const auto& [n, k] : c.some({std::array<long, 2>{1, 1}, {3, 7}, {7, 63}, {5, 64}, {13, 131}})) {
    const std::size_t rows = norm_size(n), all = norm_size(n, k);
    const auto w = random_floats(all, 1), b = random_floats(rows, 2), s = random_floats(rows, 3),
               dw = random_floats(all, 4), db = random_floats(rows, 5);
    const ref::LayerScaleCase want{as_doubles(w), as_doubles(b), as_doubles(s)};
    const LayerScaleForward f{c.up({n, k}, w), c.up({n}, b), c.up({n}, s), c.gap({n, k}), c.gap({n})};
    layer_scale_forward(c.ctx, f);
    auto got = c.ctx.read<float>(f.out_weight);
    const auto bias = c.ctx.read<float>(f.out_bias);
    got.insert(got.end(), bias.begin(), bias.end());
    c.close("forward", got, want.forward(), 1e-6);
    const LayerScaleBackward g{f.weight,      f.bias,          f.scale,      c.up({n, k}, dw),
                               c.up({n}, db), c.up({n, k}, w), c.up({n}, b), c.up({n}, s)};
    layer_scale_backward(c.ctx, g);
    std::vector<float> dy = dw;
    dy.insert(dy.end(), db.begin(), db.end());
    c.close(
        "backward, dweight", g.dweight, [&] { return plus(want.gradient(&ref::LayerScaleCase::w, dy), w); }, 1e-5);
    c.close(
        "backward, dbias", g.dbias, [&] { return plus(want.gradient(&ref::LayerScaleCase::b, dy), b); }, 1e-5);
    c.close(
        "backward, dscale", g.dscale, [&] { return plus(want.gradient(&ref::LayerScaleCase::s, dy), s); }, 1e-5);
  }
}

}  // namespace

std::vector<Case> norm_cases() {
  return {{"layernorm", layernorm_all}, {"groupnorm", groupnorm_all}, {"layer_scale", layer_scale_all}};
}

}  // namespace vsplat::selftest

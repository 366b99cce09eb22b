#include "model/diagnose/selftest/reference/layernorm.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/layernorm.h"

namespace vsplat::selftest {
namespace {

void layernorm_of(Checks& c, const std::vector<float>& x, long rows, long channels, double tolerance = 1e-5) {
  const std::size_t n = size_of(channels);
  const auto gamma = random_floats(n, 5, 0.5f, 1.5f), beta = random_floats(n, 4), dy = random_floats(x.size(), 6);
  const Tensor in = c.up({rows, channels}, x), out = c.gap({rows, channels});
  layernorm_forward(c.ctx, {in, c.up({channels}, gamma), c.up({channels}, beta), 1e-6f, out});
  c.close("forward", out, ref::layernorm(x, n, gamma, beta, 1e-6), tolerance);
  if (c.all) {
    const Tensor there = c.up({rows, channels}, x);
    layernorm_forward(c.ctx, {there, c.up({channels}, gamma), c.up({channels}, beta), 1e-6f, there});
    c.close("forward, in place", there, ref::layernorm(x, n, gamma, beta, 1e-6), tolerance);
  }
  if (channels == 1) return;  // its own mean: what reaches x is rounding
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
    c.close("backward, dx", a.dx, add ? plus(want.x, before) : want.x, tolerance);
    c.close("backward, dgamma", a.dgamma, plus(want.gamma, some), tolerance);
    c.close("backward, dbeta", a.dbeta, plus(want.beta, some), tolerance);
  }
  if (!c.all || rows == 0) return;
  // Without weights: as with ones and zeros.
  const std::vector<float> ones(n, 1.0f), zeros(n, 0.0f);
  const Tensor plain = c.gap({rows, channels}), dx = c.gap({rows, channels});
  layernorm_forward(c.ctx, {in, {}, {}, 1e-5f, plain});
  c.close("forward, without weights", plain, ref::layernorm(x, n, ones, zeros, 1e-5), tolerance);
  layernorm_backward(c.ctx, {in, {}, 1e-5f, c.up({rows, channels}, dy), dx, {}, {}});
  c.close("backward, without weights", dx, ref::layernorm_backward(x, n, ones, 1e-5, as_doubles(dy)).x, tolerance);
}

void layernorm_of(Checks& c, long rows, long channels) {
  layernorm_of(c, random_floats(size_of(rows, channels), static_cast<std::uint32_t>(channels), -2, 3), rows, channels);
}

void modulation_of(Checks& c, long v, long p, long channels) {
  const std::size_t n = size_of(channels), kept = size_of(v, p), run = size_of(p);
  const auto x = random_floats(size_of(v * (1 + p), channels), 9, -2, 2), film = random_floats(kept * 2 * n, 10),
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
  const auto some = random_floats(n, 8), before = random_floats(x.size(), 7);
  for (const bool add : c.some({false}, {true})) {
    const Tensor dx = add ? c.up(in.shape(), before) : c.gap(in.shape());
    const ModulateBackward a{in,
                             g,
                             b,
                             f,
                             1e-6f,
                             c.up({v, p, channels}, dy),
                             dx,
                             c.gap(f.shape()),
                             c.up({channels}, some),
                             c.up({channels}, some),
                             add};
    modulate_backward(c.ctx, a);
    c.close("modulation, dx", a.dx, add ? plus(want.x, before) : want.x, 1e-5);
    c.close("modulation, dfilm", a.dfilm, by_film, 1e-5);
    c.close("modulation, dgamma", a.dgamma, plus(want.gamma, some), 1e-5);
    c.close("modulation, dbeta", a.dbeta, plus(want.beta, some), 1e-5);
  }
}

void layernorm_all(Checks& c) {
  for (const auto& [rows, channels] :
       c.some({std::array<long, 2>{1, 3}, {3, 7}, {63, 15}, {64, 16}, {65, 17}, {3, 65}, {7, 384}, {4099, 5}}))
    layernorm_of(c, rows, channels);
  modulation_of(c, 1, 1, 6);
  modulation_of(c, 3, 35, 37);
  if (!c.all) return;
  for (const long channels : {3L, 7L, 15L, 16L, 17L, 63L, 64L, 65L, 101L, 384L})
    for (const long rows : {1L, 3L, 63L, 64L, 65L}) layernorm_of(c, rows, channels);
  for (const long rows : {1L, 3L, 67L}) layernorm_of(c, rows, 1);
  layernorm_of(c, 9001, 5);  // more rows than sums of sums take in two steps
  // Values far from zero with a small deviation: float32 itself keeps them to 3 * 6e-8 / 0.01 of the deviation. And a
  // deviation as small as eps, which shows.
  auto far = random_floats(5 * 96, 7, -0.01f, 0.01f);
  for (float& v : far) v += 3;
  layernorm_of(c, far, 5, 96, 1e-4);
  layernorm_of(c, random_floats(4 * 40, 8, -1e-3f, 1e-3f), 4, 40);
  layernorm_of(c, 0, 4);
  modulation_of(c, 2, 9, 24);
}

}  // namespace

VSPLAT_CASES(layernorm, {"layernorm", layernorm_all})

}  // namespace vsplat::selftest

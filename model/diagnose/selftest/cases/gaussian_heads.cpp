// The heads' numbers to Gaussians, and which of these are refined.
#include <array>

#include "model/base/rng.h"
#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/decode.h"
#include "model/diagnose/selftest/reference/select.h"
#include "model/ops/networks/decode.h"
#include "model/ops/volume/select.h"

namespace vsplat::selftest {
namespace {

std::size_t gaussian_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }

DeviceGaussians gap_gaussians(Checks& c, long n, long s, long scales = 3) {
  return {c.gap({n, 3}), c.gap({n, scales}), c.gap({n, 4}), c.gap({n}), c.gap({n, s, 3})};
}

void check_gaussians(Checks& c, const DeviceGaussians& got, const ref::GaussianLists& want) {
  c.close("means", got.means, want.means, 1e-6);
  c.close("scales", got.scales, want.scales, 1e-6);
  c.close("rotations", got.quats, want.quats, 1e-6);
  c.close("opacities", got.opacities, want.opacities, 1e-6);
  c.close("harmonics", got.sh, want.sh, 0);
}

// A loss that is linear in every Gaussian: its derivatives.
ref::GaussianLists slopes(long n, long s, long scales = 3) {
  return {random_doubles(gaussian_size(3 * n), 51), random_doubles(gaussian_size(scales * n), 52),
          random_doubles(gaussian_size(4 * n), 53), random_doubles(gaussian_size(n), 54),
          random_doubles(gaussian_size(3 * s * n), 55)};
}

GaussianGradients up_slopes(Checks& c, const ref::GaussianLists& g, long n, long s, long scales = 3) {
  return {c.up({n, 3}, as_floats(g.means)), c.up({n, scales}, as_floats(g.scales)), c.up({n, 4}, as_floats(g.quats)),
          c.up({n}, as_floats(g.opacities)), c.up({n, s, 3}, as_floats(g.sh))};
}

// Part by part: they are of different sizes.
void check_raw(Checks& c, const Tensor& draw, const std::vector<double>& want, long sh, long scales,
               bool moved = true) {
  const auto got = c.ctx.read<float>(draw);
  const long first = moved ? 3 : 0, size = 5 + first + scales + sh;
  const long ends[] = {0, first, first + sh, first + sh + 1, first + sh + 1 + scales, size};
  for (int part = moved ? 0 : 1; part < 5; ++part) {
    std::vector<float> some;
    std::vector<double> expected;
    for (std::size_t i = 0; i < want.size(); ++i) {
      const long at = static_cast<long>(i) % size;
      if (at < ends[part] || at >= ends[part + 1]) continue;
      some.push_back(got[i]), expected.push_back(want[i]);
    }
    c.close("backward, draw", some, expected, 1e-6);
  }
}

void decode_coarse_all(Checks& c) {
  struct Try {
    long r, s, each, scales;
    bool exponential;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 3, false},
                              {3, 4, 2, 2, true},
                              {2, 9, 3, 2, false},
                              {5, 4, 2, 3, false},
                              {4, 16, 1, 3, true}})) {
    const long n = t.r * t.r * t.r * t.each, size = 8 + t.scales + 3 * t.s;
    const CoarseKind kind{t.each, 0.6, t.exponential};
    const auto raw = random_floats(gaussian_size(n, size), 41, -4.0f, 4.0f);
    const DeviceGaussians out = gap_gaussians(c, n, t.s, t.scales);
    const Tensor in = c.up({t.r * t.r * t.r, t.each * size}, raw);
    decode_coarse_forward(c.ctx, {in, t.r, out, kind});
    ref::GaussianLists want;
    const ref::GaussianLists d = slopes(n, t.s, t.scales);
    std::vector<double> by;
    const double voxel = 1.0 / static_cast<double>(t.r);
    for (long k = 0; k < n; ++k) {
      const long i = k / t.each;
      const double anchor[3] = {(static_cast<double>(i / (t.r * t.r)) + 0.5) * voxel - 0.5,
                                (static_cast<double>(i / t.r % t.r) + 0.5) * voxel - 0.5,
                                (static_cast<double>(i % t.r) + 0.5) * voxel - 0.5};
      const float* row = &raw[gaussian_size(k, size)];
      ref::decode(row, anchor, 0.6 * voxel, voxel, 3 * t.s, want, static_cast<int>(t.scales), t.exponential);
      ref::decode_backward(row, 0.6 * voxel, voxel, 3 * t.s, d, gaussian_size(k), by, gaussian_size(t.scales),
                           t.exponential);
    }
    check_gaussians(c, out, want);
    const Tensor draw = c.gap(in.shape());
    decode_coarse_backward(c.ctx, {in, t.r, up_slopes(c, d, n, t.s, t.scales), draw, kind});
    check_raw(c, draw, by, 3 * t.s, t.scales);
  }
}

void decode_fine_all(Checks& c) {
  for (const auto& [p, m, s] : c.some({std::array<long, 3>{1, 1, 1}, {7, 3, 4}, {65, 2, 4}, {3, 16, 4}})) {
    const long r = 6, size = 11 + 3 * s, n = p * m;
    const auto raw = random_floats(gaussian_size(n, size), 42, -4.0f, 4.0f),
               means = random_floats(gaussian_size(3 * p), 45),
               offsets = random_floats(gaussian_size(3 * m), 44, -0.04f, 0.04f),
               before = random_floats(gaussian_size(3 * p), 46);
    const Tensor in = c.up({p, m * size}, raw), draw = c.gap({p, m * size}), dcentres = c.up({p, 3}, before);
    const DeviceGaussians out = gap_gaussians(c, n, s);
    decode_fine_forward(c.ctx, {in, c.up({p, 3}, means), c.up({m, 3}, offsets), r, out});
    const ref::GaussianLists d = slopes(n, s);
    ref::GaussianLists want;
    std::vector<double> by, by_centres(before.begin(), before.end());
    for (long k = 0; k < n; ++k) {
      double anchor[3];
      for (long i = 0; i < 3; ++i) {
        anchor[i] = static_cast<double>(means[gaussian_size(k / m * 3 + i)]) +
                    static_cast<double>(offsets[gaussian_size(k % m * 3 + i)]);
        by_centres[gaussian_size(k / m * 3 + i)] += d.means[gaussian_size(3 * k + i)];
      }
      const float* row = &raw[gaussian_size(k, size)];
      ref::decode(row, anchor, 1.0 / 48, 1.0 / 6, 3 * s, want);
      ref::decode_backward(row, 1.0 / 48, 1.0 / 6, 3 * s, d, gaussian_size(k), by);
    }
    check_gaussians(c, out, want);
    decode_fine_backward(c.ctx, {in, r, up_slopes(c, d, n, s), draw, dcentres});
    check_raw(c, draw, by, 3 * s, 3);
    c.close("backward, dcentres", dcentres, by_centres, 1e-6);
  }
}

void decode_points_all(Checks& c) {
  for (const auto& [p, s] : c.some({std::array<long, 2>{1, 1}, {7, 4}, {65, 4}, {3, 9}})) {
    const long size = 8 + 3 * s;
    const double unit = 0.02;
    const auto raw = random_floats(gaussian_size(p, size), 61, -4.0f, 4.0f),
               points = random_floats(gaussian_size(3 * p), 62);
    const Tensor in = c.up({p, size}, raw), draw = c.gap({p, size}), dpoints = c.gap({p, 3});
    const DeviceGaussians out = gap_gaussians(c, p, s);
    decode_points_forward(c.ctx, {in, c.up({p, 3}, points), unit, 0, out});
    const ref::GaussianLists d = slopes(p, s);
    ref::GaussianLists want;
    std::vector<double> by;
    for (long i = 0; i < p; ++i) {
      // With an offset of 0 in front, which moves nothing.
      std::vector<double> row(raw.begin() + i * size, raw.begin() + (i + 1) * size), back;
      row.insert(row.begin(), 3, 0.0);
      const float* at = &points[gaussian_size(3 * i)];
      const double anchor[3] = {at[0], at[1], at[2]};
      ref::decode(row.data(), anchor, 0, 3 * unit, 3 * s, want, 3, true);
      ref::decode_backward(row.data(), 0, 3 * unit, 3 * s, d, gaussian_size(i), back, 3, true);
      by.insert(by.end(), back.begin() + 3, back.end());
    }
    check_gaussians(c, out, want);
    decode_points_backward(c.ctx, {in, unit, 0, up_slopes(c, d, p, s), draw, dpoints});
    check_raw(c, draw, by, 3 * s, 3, false);
    c.close("backward, dpoints", dpoints, d.means, 1e-6);
  }
}

void decode_adjusted_all(Checks& c) {
  for (const auto& [p, s] : c.some({std::array<long, 2>{1, 1}, {7, 4}, {65, 4}})) {
    const std::size_t n = gaussian_size(p), sh = gaussian_size(3 * s);
    const auto update = random_floats(n * (sh + 1), 43, -3.0f, 3.0f);
    const auto up_random = [&](const Shape& shape, std::size_t each, std::uint32_t seed, std::vector<float>& to) {
      to = random_floats(n * each, seed, 0.01f, 1.0f);
      return c.up(shape, to);
    };
    std::vector<float> means, scales, quats, opacities, harmonics;
    const DeviceGaussians skeleton{up_random({p, 3}, 3, 45, means), up_random({p, 3}, 3, 46, scales),
                                   up_random({p, 4}, 4, 47, quats), up_random({p}, 1, 48, opacities),
                                   up_random({p, s, 3}, sh, 49, harmonics)};
    const DeviceGaussians out = gap_gaussians(c, p, s);
    const Tensor in = c.up({p, 3 * s + 1}, update), draw = c.gap(in.shape());
    decode_adjusted_forward(c.ctx, {in, skeleton, 0, out});
    const ref::GaussianLists d = slopes(p, s);
    ref::GaussianLists want{as_doubles(means), as_doubles(scales), as_doubles(quats), {}, {}};
    std::vector<double> by, by_opacity(opacities.begin(), opacities.end());
    for (std::size_t i = 0; i < n; ++i) {
      const float* row = &update[i * (sh + 1)];
      const double factor = ref::logistic(row[sh]);
      want.sh.insert(want.sh.end(), row, row + sh);
      want.opacities.push_back(factor * static_cast<double>(opacities[i]));
      by.insert(by.end(), d.sh.begin() + static_cast<long>(i * sh), d.sh.begin() + static_cast<long>((i + 1) * sh));
      by.push_back(d.opacities[i] * static_cast<double>(opacities[i]) * factor * (1 - factor));
      by_opacity[i] += d.opacities[i] * factor;
    }
    check_gaussians(c, out, want);
    const GaussianGradients to{c.zeros({p, 3}), c.zeros({p, 3}), c.zeros({p, 4}), c.up({p}, opacities), {}};
    decode_adjusted_backward(c.ctx, {in, skeleton.opacities, 0, up_slopes(c, d, p, s), draw, to});
    c.close("backward, draw", draw, by, 1e-6);
    c.close("backward, opacities", to.opacities, by_opacity, 1e-6);
    c.close("backward, means", to.means, d.means, 1e-6);
    c.close("backward, scales", to.scales, d.scales, 1e-6);
    c.close("backward, rotations", to.quats, d.quats, 1e-6);
  }
}

void select_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 1009L}))
    for (const std::string selection : {"gumbel", "sigmoid", "ste", "opacity"}) {
      const std::size_t count = gaussian_size(n);
      const auto logits = random_floats(count, 51), opacities = random_floats(count, 52, 0.0f, 1.0f),
                 noise = random_floats(count, 53, -2.0f, 2.0f), d = random_floats(count, 57, 0.5f, 1.5f);
      SelectForward f;
      f.logits = c.up({n}, logits), f.noise = c.up({n}, noise), f.opacities = c.up({n}, opacities);
      f.selection = selection_of(selection), f.temperature = 0.3f, f.opacity_threshold = 0.4f;
      f.factor = c.gap({n}), f.refined = c.gap({n}), f.flags = c.up({n}, std::vector<std::uint32_t>(count, 7));
      select_forward(c.ctx, f);
      std::vector<double> factor, refined, by_logit, by_opacity;
      std::vector<std::uint32_t> flags;
      for (std::size_t i = 0; i < count; ++i) {
        const auto one = ref::select(selection, logits[i], noise[i], opacities[i], static_cast<double>(0.3f), 0.4f);
        const auto by =
            ref::select_backward(selection, logits[i], noise[i], opacities[i], static_cast<double>(0.3f), d[i]);
        factor.push_back(one.factor), refined.push_back(one.refined), flags.push_back(one.flag);
        by_logit.push_back(by.logit), by_opacity.push_back(by.opacity);
      }
      c.close("factor", f.factor, factor, 1e-6);
      c.close("refined", f.refined, refined, 1e-6);
      c.equal("flags", f.flags, flags);
      const SelectBackward b{f.logits,      f.noise,      f.opacities, f.selection,
                             f.temperature, c.up({n}, d), c.gap({n}),  c.gap({n})};
      select_backward(c.ctx, b);
      c.close("backward, dlogits", b.dlogits, by_logit, 2e-6);
      c.close("backward, dopacities", b.dopacities, by_opacity, 1e-6);
    }
  const long n = 2001;
  const std::uint64_t seed = 0x123456789abcdefULL;
  const Tensor noise = c.gap({n});
  logistic_noise(c.ctx, noise, seed, 7, 3);
  std::vector<double> want;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double u = uniform_open(philox4x32_10({i, 7, 3, 0}, rng_key(seed))[0]);
    want.push_back(std::log(u) - std::log(1 - u));
  }
  c.close("noise", noise, want, 1e-6);
}

}  // namespace

std::vector<Case> gaussian_cases() {
  return {{"decode_coarse", decode_coarse_all},
          {"decode_fine", decode_fine_all},
          {"decode_points", decode_points_all},
          {"decode_adjusted", decode_adjusted_all},
          {"select", select_all}};
}

}  // namespace vsplat::selftest

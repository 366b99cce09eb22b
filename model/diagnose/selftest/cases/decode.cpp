#include "model/diagnose/selftest/reference/decode.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/gaussian_lists.h"
#include "model/ops/networks/decode.h"

namespace vsplat::selftest {
namespace {

void check_gaussians(Checks& c, const DeviceGaussians& got, const ref::GaussianLists& want) {
  c.close("means", got.means, want.means, 1e-6);
  c.close("scales", got.scales, want.scales, 1e-6);
  c.close("rotations", got.quats, want.quats, 1e-6);
  c.close("opacities", got.opacities, want.opacities, 1e-6);
  c.close("harmonics", got.sh, want.sh, 0);
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
    c.close("backward, draw", some, expected, c.within(1e-6, part == 1 ? 0 : 1e-6));
  }
}

void decode_coarse_all(Checks& c) {
  struct Try {
    long r, s, each, scales;
    bool exponential;
    double reach = 0.6;
  };
  for (const Try& t : c.some(
           {Try{1, 1, 1, 3, false}, {3, 4, 2, 2, true}, {2, 9, 3, 2, false}, {5, 4, 2, 3, false}, {4, 16, 1, 3, true}},
           {{3, 1, 1, 3, true},
            {1, 1, 1, 3, false, 0.25},
            {3, 4, 1, 3, false, 0.25},
            {5, 9, 1, 3, false, 0.25},
            {4, 16, 1, 3, false, 0.25}})) {
    const long n = t.r * t.r * t.r * t.each, size = 8 + t.scales + 3 * t.s;
    const CoarseKind kind{t.each, t.reach, t.exponential};
    const auto raw = random_floats(size_of(n, size), 41, -4.0f, 4.0f);
    const DeviceGaussians out = gap_gaussians(c.ctx, n, t.s, t.scales);
    const Tensor in = c.up({t.r * t.r * t.r, t.each * size}, raw);
    decode_coarse_forward(c.ctx, {in, t.r, out, kind});
    ref::GaussianLists want;
    const ref::GaussianLists d = slopes(n, t.s, t.scales);
    std::vector<double> by;
    const double voxel = 1.0 / static_cast<double>(t.r);
    for (long k = 0; k < n; ++k) {
      const long i = k / t.each;
      const long x = i / (t.r * t.r), y = i / t.r % t.r, z = i % t.r;
      const double anchor[3] = {(static_cast<double>(x) + 0.5) * voxel - 0.5,
                                (static_cast<double>(y) + 0.5) * voxel - 0.5,
                                (static_cast<double>(z) + 0.5) * voxel - 0.5};
      const float* row = &raw[size_of(k, size)];
      ref::decode(row, anchor, t.reach * voxel, voxel, 3 * t.s, want, static_cast<int>(t.scales), t.exponential);
      ref::decode_backward(row, t.reach * voxel, voxel, 3 * t.s, d, size_of(k), by, size_of(t.scales), t.exponential);
    }
    check_gaussians(c, out, want);
    const Tensor draw = c.gap(in.shape());
    decode_coarse_backward(c.ctx, {in, t.r, up_slopes(c.ctx, d, n, t.s, t.scales), draw, kind});
    check_raw(c, draw, by, 3 * t.s, t.scales);
  }
}

void decode_fine_all(Checks& c) {
  for (const auto& [p, m, s] : c.some({std::array<long, 3>{1, 1, 1}, {7, 3, 4}, {65, 2, 4}, {3, 16, 4}})) {
    const long r = 6, size = 11 + 3 * s, n = p * m;
    const auto raw = random_floats(size_of(n, size), 42, -4.0f, 4.0f), means = random_floats(size_of(3 * p), 45),
               offsets = random_floats(size_of(3 * m), 44, -0.04f, 0.04f), before = random_floats(size_of(3 * p), 46);
    const Tensor in = c.up({p, m * size}, raw), draw = c.gap({p, m * size}), dcentres = c.up({p, 3}, before);
    const DeviceGaussians out = gap_gaussians(c.ctx, n, s);
    decode_fine_forward(c.ctx, {in, c.up({p, 3}, means), c.up({m, 3}, offsets), r, out});
    const ref::GaussianLists d = slopes(n, s);
    ref::GaussianLists want;
    std::vector<double> by, by_centres(before.begin(), before.end());
    for (long k = 0; k < n; ++k) {
      double anchor[3];
      for (long i = 0; i < 3; ++i) {
        anchor[i] =
            static_cast<double>(means[size_of(k / m * 3 + i)]) + static_cast<double>(offsets[size_of(k % m * 3 + i)]);
        by_centres[size_of(k / m * 3 + i)] += d.means[size_of(3 * k + i)];
      }
      const float* row = &raw[size_of(k, size)];
      ref::decode(row, anchor, 1.0 / 48, 1.0 / 6, 3 * s, want);
      ref::decode_backward(row, 1.0 / 48, 1.0 / 6, 3 * s, d, size_of(k), by);
    }
    check_gaussians(c, out, want);
    decode_fine_backward(c.ctx, {in, r, up_slopes(c.ctx, d, n, s), draw, dcentres});
    check_raw(c, draw, by, 3 * s, 3);
    c.close("backward, dcentres", dcentres, by_centres, 1e-6);
  }
}

void decode_points_all(Checks& c) {
  for (const auto& [p, s] : c.some({std::array<long, 2>{1, 1}, {7, 4}, {65, 4}, {3, 9}})) {
    const long size = 8 + 3 * s;
    const double unit = 0.02;
    const auto raw = random_floats(size_of(p, size), 61, -4.0f, 4.0f), points = random_floats(size_of(3 * p), 62);
    const Tensor in = c.up({p, size}, raw), draw = c.gap({p, size}), dpoints = c.gap({p, 3});
    const DeviceGaussians out = gap_gaussians(c.ctx, p, s);
    decode_points_forward(c.ctx, {in, c.up({p, 3}, points), unit, 0, out});
    const ref::GaussianLists d = slopes(p, s);
    ref::GaussianLists want;
    std::vector<double> by;
    for (long i = 0; i < p; ++i) {
      // With an offset of 0 in front, which moves nothing.
      std::vector<double> row(raw.begin() + i * size, raw.begin() + (i + 1) * size), back;
      row.insert(row.begin(), 3, 0.0);
      const float* at = &points[size_of(3 * i)];
      const double anchor[3] = {at[0], at[1], at[2]};
      ref::decode(row.data(), anchor, 0, 3 * unit, 3 * s, want, 3, true);
      ref::decode_backward(row.data(), 0, 3 * unit, 3 * s, d, size_of(i), back, 3, true);
      by.insert(by.end(), back.begin() + 3, back.end());
    }
    check_gaussians(c, out, want);
    if (c.all) c.close("means, to the bit", out.means, want.means, 0);
    decode_points_backward(c.ctx, {in, unit, 0, up_slopes(c.ctx, d, p, s), draw, dpoints});
    check_raw(c, draw, by, 3 * s, 3, false);
    c.close("backward, dpoints", dpoints, d.means, c.within(1e-6, 0));
  }
}

void decode_adjusted_all(Checks& c) {
  for (const auto& [p, s] : c.some({std::array<long, 2>{1, 1}, {7, 4}, {65, 4}})) {
    const std::size_t n = size_of(p), sh = size_of(3 * s);
    const auto update = random_floats(n * (sh + 1), 43, -3.0f, 3.0f);
    const auto up_random = [&](const Shape& shape, std::size_t each, std::uint32_t seed, std::vector<float>& to) {
      to = random_floats(n * each, seed, 0.01f, 1.0f);
      return c.up(shape, to);
    };
    std::vector<float> means, scales, quats, opacities, harmonics;
    const DeviceGaussians skeleton{up_random({p, 3}, 3, 45, means), up_random({p, 3}, 3, 46, scales),
                                   up_random({p, 4}, 4, 47, quats), up_random({p}, 1, 48, opacities),
                                   up_random({p, s, 3}, sh, 49, harmonics)};
    const DeviceGaussians out = gap_gaussians(c.ctx, p, s);
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
    const auto means0 = random_floats(3 * n, 61), scales0 = random_floats(3 * n, 62), quats0 = random_floats(4 * n, 63);
    const GaussianGradients to{
        c.up({p, 3}, means0), c.up({p, 3}, scales0), c.up({p, 4}, quats0), c.up({p}, opacities), {}};
    decode_adjusted_backward(c.ctx, {in, skeleton.opacities, 0, up_slopes(c.ctx, d, p, s), draw, to});
    c.close("backward, draw", draw, by, c.within(1e-6, 1e-7));
    c.close("backward, opacities", to.opacities, by_opacity, 1e-6);
    c.close("backward, means", to.means, plus(d.means, means0), 1e-6);
    c.close("backward, scales", to.scales, plus(d.scales, scales0), 1e-6);
    c.close("backward, rotations", to.quats, plus(d.quats, quats0), 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(decode, {"decode_coarse", decode_coarse_all}, {"decode_fine", decode_fine_all},
             {"decode_points", decode_points_all}, {"decode_adjusted", decode_adjusted_all})

}  // namespace vsplat::selftest

#include "model/ops/fit/splat_split.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/fit_states.h"

namespace vsplat::selftest {
namespace {

constexpr double kSplitLeast = 0.005, kOffset = 0.5;

// The Gaussians to split, ascending: of those that stay, the `splits` with the highest scores, the first of equal ones.
std::vector<std::size_t> highest(const std::vector<float>& scores, const std::vector<bool>& free, std::size_t splits) {
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < scores.size(); ++k)
    if (!free[k]) out.push_back(k);
  std::stable_sort(out.begin(), out.end(), [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
  out.resize(splits);
  std::sort(out.begin(), out.end());
  return out;
}

void splat_split_of(Checks& c, std::size_t count, double growth, float gone_share) {
  const auto random = random_floats(count, static_cast<std::uint32_t>(count), 0, 1);
  const auto grow_to = static_cast<std::size_t>(growth * static_cast<double>(count)), capacity = grow_to + 2;
  FitRows x = fit_rows(count, capacity, 1);
  const FitRows m = fit_rows(count, capacity, 11), v = fit_rows(count, capacity, 21);
  std::vector<bool> free;
  std::vector<float> scores;
  for (std::size_t k = 0; k < count; ++k) {
    free.push_back(random[k] < gone_share);
    x.logits[k] = free[k] ? -20.0f : 4 * x.logits[k] + 8;        // opacities from 0.018 to 0.98
    scores.push_back(std::floor(40 * random[(7 * k) % count]));  // some are equal, some 0
  }
  const auto gone = static_cast<std::size_t>(std::count(free.begin(), free.end(), true));
  const std::size_t splits = std::min(gone + grow_to - count, count - gone);
  const std::size_t want_count = count + (splits > gone ? splits - gone : 0);
  const SplatSplit a{{up_rows(c.ctx, x), up_rows(c.ctx, m), up_rows(c.ctx, v)},
                     static_cast<long>(count),
                     static_cast<long>(grow_to),
                     c.up({static_cast<long>(count)}, scores)};
  c.that("how many", splat_split(c.ctx, a) == static_cast<long>(want_count));

  std::vector<double> means(x.means.begin(), x.means.end()), scales(x.log_scales.begin(), x.log_scales.end()),
      logits(x.logits.begin(), x.logits.end());
  std::vector<float> quats = x.quats, sh = x.sh, moments = v.log_scales, sh_moments = m.sh;
  const std::vector<std::size_t> sources = highest(scores, free, splits);
  std::size_t next = 0;  // free place
  for (std::size_t j = 0; j < splits; ++j) {
    while (next < count && !free[next]) ++next;
    const std::size_t k = sources[j], to = next++;
    const float *s = &x.log_scales[3 * k], *q = &x.quats[4 * k];
    const auto axis = static_cast<std::size_t>(std::max_element(s, s + 3) - s);
    const Eigen::Matrix3d turn = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
    const double half = 1 - std::sqrt(1 - sigmoid(x.logits[k]));
    for (const auto& [at, side] : {std::pair{k, -1.0}, {to, 1.0}}) {
      for (std::size_t i = 0; i < 3; ++i) {
        means[3 * at + i] = x.means[3 * k + i] + side * kOffset * std::exp(static_cast<double>(s[axis])) *
                                                     turn(static_cast<long>(i), static_cast<long>(axis));
        scales[3 * at + i] = s[i] + (i == axis ? 0.5 * std::log(1 - kOffset * kOffset) : 0);
        moments[3 * at + i] = 0;
      }
      logits[at] = std::log(std::max(half, kSplitLeast) / (1 - std::max(half, kSplitLeast)));
      std::copy_n(&x.quats[4 * k], 4, &quats[4 * at]);
      std::copy_n(&x.sh[12 * k], 12, &sh[12 * at]);
      std::fill_n(&sh_moments[12 * at], 12, 0.0f);
    }
  }
  c.close("means", a.all.x.means, means, 1e-6);
  c.close("scales", a.all.x.log_scales, scales, 1e-6);
  c.close("opacities", a.all.x.logits, logits, 1e-5);
  c.equal("rotations", a.all.x.quats, quats);
  c.equal("harmonics", a.all.x.sh, sh);
  c.equal("moments of scales", a.all.v.log_scales, moments);
  c.equal("moments of harmonics", a.all.m.sh, sh_moments);
}

void error_of(Checks& c, long pixels) {
  const auto colour = random_floats(static_cast<std::size_t>(3 * pixels), 3, -0.3f, 1.3f),
             target = random_floats(static_cast<std::size_t>(3 * pixels), 4, 0, 1);
  const Tensor error = c.gap({pixels, 1});
  splat_error(c.ctx, c.up({pixels, 1, 3}, colour), c.up({pixels, 1, 3}, target), error);
  std::vector<double> want(static_cast<std::size_t>(pixels));
  for (std::size_t i = 0; i < colour.size(); ++i)
    want[i / 3] += std::abs(std::clamp<double>(colour[i], 0, 1) - target[i]) / 3;
  c.close("error", error, want, 1e-6);
}

// Visible Gaussians with 0 to 8 rows each, of which every fourth was not written.
void scores_of(Checks& c, std::size_t visible) {
  constexpr double most_pixels = 5 * 256;
  std::vector<std::uint32_t> ids, offsets{0};
  for (std::size_t i = 0; i < visible; ++i) {
    ids.push_back(static_cast<std::uint32_t>(2 * i + i % 2));
    offsets.push_back(offsets.back() + static_cast<std::uint32_t>((7 * i) % 9));
  }
  const std::size_t rows = offsets.back(), all = 2 * visible + 1;
  std::vector<float> values = random_floats(10 * rows, 5, 0, 1);
  std::vector<std::uint8_t> touched(rows);
  const auto before = random_floats(all, 6, 0, 1);
  std::vector<double> want(before.begin(), before.end());
  std::vector<float> left = values;
  std::vector<float> records = random_floats(12 * visible, 8, 0, 1);
  for (std::size_t i = 0; i < visible; ++i) {
    double sum = 0;
    long tiles = 0;
    for (std::size_t r = offsets[i]; r < offsets[i + 1]; ++r) {
      touched[r] = r % 4 != 3;
      if (!touched[r]) continue;
      sum += values[10 * r + 9];
      left[10 * r + 9] = 0;
      ++tiles;
    }
    // Ellipses of 1200 to 1400 pixels around the middle, without those that rounding decides.
    const bool wide = i % 3 != 1;
    float* form = &records[12 * i + 4];
    const double room = form[0] + std::log2(255.0), area = (wide ? 1290 : 1270) + (wide ? 100 : -100) * form[1];
    form[2] *= -1;
    form[3] = static_cast<float>(std::pow(M_PI * room / area, 2) / form[2]);
    want[ids[i]] += wide && tiles > 5 ? 1e30 : sum;
  }
  Projected projected;
  projected.ids = c.up({static_cast<long>(visible)}, ids);
  projected.records = c.up({static_cast<long>(visible), 12}, records);
  const IntersectionGradients sums{c.up({static_cast<long>(rows), 10}, values),
                                   c.ctx.upload({static_cast<long>(rows)}, touched, Type::u8)};
  const Tensor scores = c.up({static_cast<long>(all)}, before);
  splat_scores(c.ctx, {projected, c.up({static_cast<long>(visible + 1)}, offsets), sums, scores, most_pixels});
  std::vector<float> got = c.ctx.read<float>(scores);
  for (std::size_t k = 0; k < all; ++k)
    if (want[k] > 1e29) c.that("covers much", got[k] > 0.99e30f), got[k] = 0, want[k] = 0;
  c.close("scores", got, want, 1e-6);
  c.equal("rows", sums.rows, left);
  const auto fresh = random_floats(all, 7, 0, 1);
  const Tensor sum = c.up({static_cast<long>(all)}, before);
  add_scores(c.ctx, c.up({static_cast<long>(all)}, fresh), sum);
  for (std::size_t k = 0; k < all; ++k) want[k] = static_cast<double>(before[k]) + static_cast<double>(fresh[k]);
  c.close("summed scores", sum, want, 1e-6);
}

void splat_split_all(Checks& c) {
  for (const std::size_t count : c.some({1UL, 3UL, 7UL, 63UL, 64UL, 65UL, 1009UL, 20011UL}, {2UL}))
    for (const double growth : {1.0, 1.3}) splat_split_of(c, count, growth, 0.3f);
  splat_split_of(c, 65, 1.1, 0);
  splat_split_of(c, 65, 2.9, 0.3f);  // more places than there are Gaussians to split
  splat_split_of(c, 65, 1.1, 0.8f);
  splat_split_of(c, 7, 1.3, 1.1f);  // all are gone
  for (const long pixels : c.some({1L, 7L, 255L, 256L, 257L, 1009L}, {3L})) error_of(c, pixels);
  for (const std::size_t visible : c.some({1UL, 7UL, 63UL, 64UL, 65UL, 1009UL}, {3UL})) scores_of(c, visible);
}

}  // namespace

VSPLAT_CASES(splat_split, {"splat_split", splat_split_all})

}  // namespace vsplat::selftest

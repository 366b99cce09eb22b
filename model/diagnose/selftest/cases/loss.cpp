#include "model/diagnose/selftest/reference/loss.h"

#include <array>
#include <cmath>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/smooth_pictures.h"
#include "model/ops/fit/loss.h"

namespace vsplat::selftest {
namespace {

// Pictures that are their target but for some noise: none near 0, 1 or the target, where the loss has kinks.
std::vector<float> off_target(const std::vector<float>& target, std::uint32_t seed, float noise = 0.3f) {
  auto out = random_floats(target.size(), seed, -noise, noise);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (std::abs(out[i]) < 1e-3f) out[i] = 2e-3f;
    out[i] += target[i];
    if (std::abs(out[i]) < 1e-3f || std::abs(out[i] - 1) < 1e-3f) out[i] += 3e-3f;
  }
  return out;
}

void loss_of(Checks& c, const std::vector<float>& pictures, const std::vector<float>& target, const Shape& shape,
             ErrorKind error, SimilarityKind similarity, float ssim_weight) {
  const long h = shape[1], w = shape[2];
  PictureLoss a{c.up(shape, pictures), c.up(shape, target), ssim_weight, c.gap({3}), c.gap(shape)};
  a.error = error, a.similarity = similarity;
  picture_loss(c.ctx, a);
  const ref::LossKind kind{error == ErrorKind::absolute, similarity == SimilarityKind::single_scale,
                           similarity != SimilarityKind::none};
  const auto wide = as_doubles(pictures);
  const auto weight = static_cast<double>(ssim_weight);
  c.close(
      "loss", a.out,
      [&] {
        const auto want = ref::loss(wide, target, h, w, weight, kind);
        return std::vector<double>(want.begin(), want.end());
      },
      1e-6);
  const auto got = c.ctx.read<float>(a.dpictures);
  const bool slow = got.size() > 20000 && similarity != SimilarityKind::none;  // the reference
  const std::size_t stride = 1 + got.size() / (slow ? c.all ? 14 : 7 : c.all ? 180 : 40);
  std::vector<std::size_t> places{got.size() - 1};
  for (std::size_t at = 0; at + 1 < got.size(); at += stride) places.push_back(at);
  std::vector<float> some;
  some.reserve(places.size());
  for (const std::size_t at : places) some.push_back(got[at]);
  c.close(
      "gradient", some,
      [&] {
        std::vector<double> out;
        out.reserve(places.size());
        for (const std::size_t at : places) out.push_back(ref::loss_slope(wide, target, h, w, weight, at, kind));
        return out;
      },
      2e-5);
  // All of it, by what no kernel leaves out.
  bool finite = true;
  for (const float v : got) finite = finite && std::isfinite(v);
  c.that("gradient, every number", finite);
  if (!c.all) return;
  PictureLoss alone = a;
  alone.dpictures = {}, alone.out = c.gap({3});
  picture_loss(c.ctx, alone);
  c.equal("loss without its gradient", alone.out, c.ctx.read<float>(a.out));
}

void loss_of(Checks& c, long n, long h, long w, ErrorKind error, SimilarityKind similarity, float ssim_weight = 0.4f) {
  const auto target = random_floats(size_of(n * h, 3 * w), 1, 0, 1);
  loss_of(c, off_target(target, 2), target, {n, h, w, 3}, error, similarity, ssim_weight);
}

void loss_all(Checks& c) {
  for (const auto& [n, h, w] :
       c.some({std::array<long, 3>{1, 11, 11}, {2, 12, 11}, {1, 13, 31}, {3, 21, 22}, {1, 33, 32}},
              {{1, 11, 12}, {1, 11, 75}}))
    loss_of(c, n, h, w, ErrorKind::squared, SimilarityKind::automatic);
  loss_of(c, 1, 161, 162, ErrorKind::squared, SimilarityKind::automatic);  // five scales
  loss_of(c, 2, 12, 13, ErrorKind::absolute, SimilarityKind::automatic);
  loss_of(c, 2, 12, 13, ErrorKind::squared, SimilarityKind::none);
  loss_of(c, 1, 12, 13, ErrorKind::absolute, SimilarityKind::none);
  if (!c.all) return;
  loss_of(c, 1, 12, 14, ErrorKind::squared, SimilarityKind::automatic, 0);
  for (const auto& [n, h, w] : {std::array<long, 3>{1, 11, 11}, {2, 12, 11}, {3, 21, 22}, {1, 33, 75}, {1, 161, 163}})
    loss_of(c, n, h, w, ErrorKind::absolute, SimilarityKind::automatic, 0.2f);
  // Pictures smaller than a window have an error, too.
  for (const auto& [n, h, w] :
       {std::array<long, 3>{1, 1, 1}, {1, 1, 10}, {2, 7, 3}, {1, 10, 11}, {3, 21, 22}, {1, 64, 64}, {1, 161, 162}})
    for (const ErrorKind error : {ErrorKind::squared, ErrorKind::absolute})
      loss_of(c, n, h, w, error, SimilarityKind::none);
  // Smooth pictures, near their target, and of another one; five scales, of even and odd sides, from the smallest that
  // have them, and one side too few; a single scale where it would be MS-SSIM otherwise.
  auto target = smooth_pictures(2, 40, 36);
  const Shape small{2, 40, 36, 3};
  loss_of(c, off_target(target, 3, 0.02f), target, small, ErrorKind::squared, SimilarityKind::automatic, 0.5f);
  loss_of(c, off_target(target, 4, 1e-3f), random_floats(target.size(), 5, 0, 1), small, ErrorKind::squared,
          SimilarityKind::automatic, 0.5f);
  for (const auto& [h, w] : {std::array<long, 2>{161, 162}, {167, 180}}) {
    target = smooth_pictures(1, h, w);
    loss_of(c, off_target(target, 5, 0.4f), target, {1, h, w, 3}, ErrorKind::squared, SimilarityKind::automatic, 0.5f);
  }
  loss_of(c, 1, 160, 170, ErrorKind::squared, SimilarityKind::automatic, 0.5f);
  target = smooth_pictures(2, 167, 180);
  for (const ErrorKind error : {ErrorKind::squared, ErrorKind::absolute})
    loss_of(c, off_target(target, 15, 0.4f), target, {2, 167, 180, 3}, error, SimilarityKind::single_scale, 0.3f);
}

}  // namespace

VSPLAT_CASES(loss, {"loss", loss_all})

}  // namespace vsplat::selftest

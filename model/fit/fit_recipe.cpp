#include "model/fit/fit_recipe.h"

#include <algorithm>
#include <cmath>

namespace vsplat {
namespace {

// The share of an object's Gaussians that stays: with a quarter more steps, PSNR changes by less than 0.2 dB.
constexpr double kObjectShare = 0.5;
// Steps for each picture of a whole scene above which the rates of colours fall, and those of view-dependent ones are
// lower: else colours are fitted to the latest pictures, and to what only one shows. Objects lose 0.2 dB by it.
constexpr double kVisitsToFall = 20, kVisitsToLower = 125;
constexpr double kLeastFall = 0.1;
// The last rate of an object's positions, of its first: kStepsToRest / steps within the limits, so long fits end at
// rest.
constexpr double kStepsToRest = 200, kLeastMeansFall = 0.01, kMostMeansFall = 0.1;
// Where an object is narrower than this, in units of its cube, the cube is taken for too large, and lengths are in
// units of the object. nerf_synthetic's chair has a width of 0.48, photographed objects of 0.5 to 0.8.
constexpr double kNarrow = 0.45, kLeastUnit = 0.01;
constexpr double kMergedPerPixel = 0.75;                 // half of what an object may grow to
constexpr double kPixelsOfGaussian = 3;                  // a Gaussian takes as long in a step as so many pixels
constexpr long kLeastBetween = 100, kMeasurements = 20;  // measured so often, but not after fewer steps

long steps_of(FitQuality quality) {
  return quality == FitQuality::high ? 30000 : quality == FitQuality::normal ? 7000 : 2000;
}

// Without growth. The learning rates do not depend on the number of steps, which is not known yet.
FitRecipe for_few(Predicted predicted) {
  FitRecipe out;
  out.steps = 200;
  out.measure_every = 25;
  if (predicted == Predicted::no)
    out.options.drop = 0.1f;  // helps a little
  else
    out.options = predicted == Predicted::fitted ? options_for_predicted() : options_to_thin_out();
  out.options.grow_every = 0;
  return out;
}

// The regularisers, relocation and growth of 3DGS-MCMC, without its noise, which cost 0.8 dB on photographs. With its
// weight of 0.01 on opacities half of the Gaussians end below an opacity of 0.1. As in 3DGS, a fifth of the loss is
// D-SSIM. This improves PSNR, too, if there are as many Gaussians as pixels; with a third as many it does not.
FitRecipe for_many(FitQuality quality, double object_pixels, long count) {
  FitRecipe out;
  out.steps = steps_of(quality) * 5 / 4;  // the last quarter runs with half of the Gaussians
  out.least_degree = 3;
  out.options.ssim_weight = 0.2f;
  out.options.opacity_weight = 0.0005f;
  out.options.scale_weight = 0.1f;
  out.options.grow_every = 50;
  out.options.max_gaussians = std::max(static_cast<long>(1.5 * object_pixels), 2 * count);
  return out;
}

// As for_many(), with rates for lengths in units of the cameras' spread, and with far Gaussians. A regulariser on
// scales in place of the one on opacities keeps scenes opaque.
FitRecipe for_whole(const FitRequest& request, double pixels, long count) {
  FitRecipe out = for_many(request.quality, pixels, count);
  out.steps = steps_of(request.quality);
  FitOptions& o = out.options;
  o.rates.means = request.scattered ? 1e-3 : 3e-4;
  o.opacity_weight = 0;
  o.scale_weight = 0.3f;
  o.high_scale = 100;
  o.max_gaussians = std::max(static_cast<long>(0.5 * pixels), count);
  return out;
}

}  // namespace

// With four views of 24 objects, scales and rotations that follow quickly are worth 0.1 dB each. D-SSIM and dropping
// Gaussians help a little.
FitOptions options_for_predicted() {
  FitOptions out;
  out.rates.log_scales *= 4;
  out.rates.quats *= 2;
  out.ssim_weight = 0.2f;
  out.drop = 0.2f;
  return out;
}

FitOptions options_to_thin_out() {
  FitOptions out = options_for_predicted();
  out.opacity_weight = 0.04f;
  return out;
}

int longest_of(FitQuality quality) {
  return quality == FitQuality::high ? 1600 : quality == FitQuality::normal ? 1024 : 512;
}

std::size_t merged_count(const FitRequest& request, double object_pixels) {
  const auto most = static_cast<long>(kMergedPerPixel * object_pixels);
  return static_cast<std::size_t>(
      std::max(1L, request.max_gaussians > 0 ? std::min(most, request.max_gaussians) : most));
}

double mean_count(const FitRecipe& recipe, long step, long steps, long count) {
  const FitOptions& o = recipe.options;
  const bool consolidates = recipe.consolidate < 1;
  const long reduced = (3 * steps + 3) / 4;  // steps before the consolidation
  double sum = 0, now = static_cast<double>(count);
  for (long at = step; at < steps;) {
    const bool before = !consolidates || at < reduced;
    const bool grows = before && o.grow_every > 0 && at < o.grow_until;
    long next = consolidates && before ? reduced : steps;
    if (grows) next = std::min(next, (at / o.grow_every + 1) * o.grow_every);
    sum += now * static_cast<double>(next - at);
    if (consolidates && before && next == reduced)
      now *= recipe.consolidate;
    else if (grows)
      now = std::max(now, std::min(o.growth * now, static_cast<double>(o.max_gaussians)));
    at = next;
  }
  return step < steps ? sum / static_cast<double>(steps - step) : now;
}

double step_growth(double pixels, double now, double later) {
  return (pixels / kPixelsOfGaussian + later) / (pixels / kPixelsOfGaussian + now);
}

void grow_to(FitRecipe& recipe, long most, long count) {
  FitOptions& o = recipe.options;
  o.max_gaussians = most;
  if (o.grow_every <= 0) return;
  // Growth reaches the maximum after two fifths of the steps: Gaussians that are added later are not fitted well.
  const double rounds = std::max(1.0, 0.4 * static_cast<double>(recipe.steps) / static_cast<double>(o.grow_every));
  o.growth = std::pow(static_cast<double>(most) / static_cast<double>(count), 1 / rounds);
}

FitRecipe fit_recipe(const FitRequest& request, long views, const ShownObject& shown, long count, Predicted predicted) {
  const bool many = request.whole || views >= kManyViews;
  FitRecipe out = request.whole ? for_whole(request, shown.pixels, count)
                  : many        ? for_many(request.quality, shown.pixels, count)
                                : for_few(predicted);
  FitOptions& o = out.options;
  if (request.steps > 0) out.steps = request.steps;
  if (request.whole) {
    const double visits = static_cast<double>(out.steps) / static_cast<double>(views);
    o.sh_fall = std::clamp(kVisitsToFall / visits, kLeastFall, 1.0);
    o.rates.sh_rest *= std::sqrt(std::min(1.0, kVisitsToLower / visits));
  } else if (many) {
    const double unit = std::clamp(shown.width / kNarrow, kLeastUnit, 1.0);
    o.rates.means *= unit;
    o.scale_weight /= static_cast<float>(unit);
    o.means_fall = std::clamp(kStepsToRest / static_cast<double>(out.steps), kLeastMeansFall, kMostMeansFall);
  }
  if (many) out.measure_every = std::max(kLeastBetween, out.steps / kMeasurements);
  if (many) o.steps = out.steps;
  o.grow_until = out.steps * 3 / 4;
  grow_to(out, std::max(request.max_gaussians > 0 ? request.max_gaussians : o.max_gaussians, count), count);
  const bool halves = many && !request.whole && request.max_gaussians == 0;
  out.consolidate = request.consolidate > 0 ? request.consolidate : halves ? kObjectShare : 1;
  o.density = request.density;
  o.background = request.background;
  o.depth_weight = request.depth_weight;
  o.depth_kind = request.depth_kind;
  o.seed = request.seed;
  if (request.freeze.means) o.rates.means = 0;
  if (request.freeze.scales) o.rates.log_scales = 0;
  if (request.freeze.rotations) o.rates.quats = 0;
  if (request.freeze.opacities) o.rates.logits = 0;
  if (request.freeze.sh) o.rates.sh = o.rates.sh_rest = 0;
  // Relocation would change frozen parameters.
  if (request.freeze.means || request.freeze.scales || request.freeze.opacities) o.grow_every = 0;
  if (request.consolidate <= 0 && o.grow_every == 0) out.consolidate = 1;
  return out;
}

}  // namespace vsplat

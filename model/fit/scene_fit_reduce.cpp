// The last phase's end: Gaussians that no picture misses go, and a consolidation keeps the most visible ones.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "model/base/scene_edit.h"
#include "model/fit/scene_fit_impl.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

// Blending weights of a Gaussian, summed over the pixels of all fitted pictures, below which it is pruned: at 0.2 a
// held-out picture lost at most 0.006 dB, at 0.5 up to 0.04 dB.
constexpr float kLeastWeight = 0.2f;

// Gaussians that stand for others, which have gone, are made thicker until their median opacity is this: otherwise they
// have to learn the others' opacity, and half of them may end below 0.25. Those above the limit stay as they are: there
// the opacity hardly changes any more.
constexpr float kThickened = 0.55f, kMostThickened = 0.95f;

// Multiplies optical depths, by one factor for all.
void thicken(std::vector<float>& opacities) {
  std::vector<float> sorted = opacities;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  if (*middle <= 0 || *middle >= kThickened) return;
  const float factor = std::log1p(-kThickened) / std::log1p(-*middle);
  for (float& opacity : opacities)
    opacity = std::max(opacity, std::min(-std::expm1(factor * std::log1p(-opacity)), kMostThickened));
}

}  // namespace

bool SceneFit::Impl::is_consolidated() const { return consolidated_after > 0; }
bool SceneFit::Impl::consolidates() const { return !in_folds() && recipe.consolidate < 1; }

// Continues with the Gaussians of `unreduced` that `choose` marks by their blending weights, thickened if wanted, and
// measures them as the scene after `at` steps. The best scene stays as it is if none is marked.
void SceneFit::Impl::reduce(const std::function<std::vector<bool>(const std::vector<float>&)>& choose, long at,
                            bool thickens) {
  if (unreduced->count == 0) return unreduced.reset();
  fitter->replace(*unreduced);
  const Tensor sums = ctx.tensor({fitter->count()}, Type::f32, "blending weights");
  ctx.fill_zero(sums);
  for (const int view : phases[phase].views) fitter->add_weights(corrected_camera(view), sums);
  const std::vector<bool> stays = choose(ctx.read<float>(sums));
  Gaussians kept = *unreduced;
  keep(kept, [&](std::size_t k) { return stays[k]; });
  if (kept.count == 0) return unreduced.reset();
  if (thickens) thicken(kept.opacities);
  fitter->replace(kept);
  const Measured here = measure_held_out();
  const Uncancelled whole(ctx);
  verbose("{} of {} Gaussians stay", kept.count, unreduced->count);
  unreduced.reset();
  best.reset();
  best_steps = 0;
  if (here.pictures > 0) {
    curve.erase(std::next(curve.begin()), curve.end());
    curve[at] = here;
    last_psnr = mean(here).psnr;
  }
  if (here.pictures == 0 || last_psnr > mean(curve.at(0)).psnr) {
    best = fitter->gaussians();
    best_steps = at;
  }
}

void SceneFit::Impl::consolidate() {
  const long at = fitter->steps_done();
  if (!unreduced) unreduced = fitter->foreground();
  const auto wanted = static_cast<std::size_t>(std::ceil(recipe.consolidate * static_cast<double>(unreduced->count)));
  reduce(
      [wanted](const std::vector<float>& weights) {
        std::vector<std::size_t> order(weights.size());
        std::iota(order.begin(), order.end(), std::size_t{0});
        std::stable_sort(order.begin(), order.end(),
                         [&](std::size_t a, std::size_t b) { return weights[a] > weights[b]; });
        std::vector<bool> out(weights.size(), false);
        for (std::size_t i = 0; i < std::min(order.size(), wanted); ++i) out[order[i]] = true;
        return out;
      },
      at, recipe.options.rates.logits > 0);
  consolidated_after = at;
}

void SceneFit::Impl::prune() {
  if (pruned || recipe.options.grow_every == 0 || !best) return;
  // A best scene ends with the sky of its step, which is kept: the fitter has that of the last step.
  const std::size_t sky_count = request.background.kind == FitBackground::Kind::sky ? kSkyGaussians : 0;
  const auto in_front = [sky_count](const Gaussians& g) {
    return [front = g.count - sky_count](std::size_t k) { return k < front; };
  };
  Gaussians sky = *best;
  keep(sky, std::not_fn(in_front(*best)));
  if (!unreduced) keep(unreduced.emplace(*best), in_front(*best));
  const long at = best_steps;
  reduce(
      [](const std::vector<float>& weights) {
        std::vector<bool> out;
        out.reserve(weights.size());
        for (const float weight : weights) out.push_back(weight >= kLeastWeight);
        return out;
      },
      at, false);
  if (best) {
    keep(*best, in_front(*best));
    append(*best, sky);
  }
  pruned = true;
}

}  // namespace vsplat

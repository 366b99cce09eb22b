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

}  // namespace

bool SceneFit::Impl::is_consolidated() const { return consolidated_after > 0; }
bool SceneFit::Impl::consolidates() const { return !in_folds() && recipe.consolidate < 1; }

// Continues with the Gaussians of `unreduced` that `choose` marks by their blending weights, and measures them as the
// scene after `at` steps. The best scene stays as it is if none is marked.
void SceneFit::Impl::reduce(const std::function<std::vector<bool>(const std::vector<float>&)>& choose, long at) {
  if (unreduced->count == 0) return unreduced.reset();
  fitter->replace(*unreduced);
  const Tensor sums = ctx.tensor({fitter->count()}, Type::f32, "blending weights");
  ctx.fill_zero(sums);
  for (const int view : phases[phase].views) fitter->add_weights(corrected_camera(view), sums);
  const std::vector<bool> stays = choose(ctx.read<float>(sums));
  Gaussians kept = *unreduced;
  keep(kept, [&](std::size_t k) { return stays[k]; });
  if (kept.count == 0) return unreduced.reset();
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
      at);
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
      at);
  if (best) {
    keep(*best, in_front(*best));
    append(*best, sky);
  }
  pruned = true;
}

}  // namespace vsplat

// How long a fit takes, and what a limit of its time leaves out.
#include <algorithm>
#include <optional>

#include "model/fit/scene_fit_impl.h"

namespace vsplat {

// One picture's measurement. A step renders and also runs backward.
double SceneFit::Impl::seconds_of_look() const { return look_seconds > 0 ? look_seconds : step_seconds / 3; }

// At the end every fitted picture is measured, and with growth also drawn with its gradient.
double SceneFit::Impl::looks_at_end() const {
  return (recipe.options.grow_every > 0 ? 4 : 1) * static_cast<double>(phases[phase].views.size());
}

double SceneFit::Impl::seconds_of_next() const {
  const long next = fitter->steps_done() + 1;
  const bool measures = next % recipe.measure_every == 0 || next >= phase_steps;
  double looks = measures ? static_cast<double>(phases[phase].held_out.size()) : 0;
  if (!in_folds()) looks += looks_at_end();
  return step_seconds + looks * seconds_of_look();
}

// The steps of this phase as the scene grows, with their measurements, those of the remaining folds and of the last
// phase at its full length, and the end.
double SceneFit::Impl::seconds_left() const {
  const std::optional<double> each = pace.seconds();
  if (!each || done) return 0;
  const long at = fitter->steps_done(), now = fitter->count();
  const double more = step_growth(largest_pixels, static_cast<double>(now), mean_count(recipe, at, phase_steps, now));
  const auto here = static_cast<double>(phase_steps - at);
  const double later = static_cast<double>(phases.size() - phase - 1) * static_cast<double>(recipe.steps);
  const long rounds = phase_steps / recipe.measure_every - at / recipe.measure_every;
  const double looks =
      static_cast<double>(rounds) * static_cast<double>(phases[phase].held_out.size()) + looks_at_end();
  return (more * here + later) * *each + more * looks * seconds_of_look() + seconds_of_reads(here + later);
}

// Ends the steps before the consolidation once the time left is what it and the last quarter of the steps take. It is
// left out if it would take longer than they do. Not decided in the first epoch, whose steps read pictures.
void SceneFit::Impl::leave_time_to_consolidate(double until_now) {
  const long at = fitter->steps_done();
  const auto fitted = static_cast<double>(phases[phase].views.size());
  const std::optional<double> each = pace.seconds();  // not the latest steps, which may have compiled
  if (static_cast<double>(at) < fitted || !each) return;
  // Every fitted picture is drawn with its gradient, and those held out are measured.
  const double reducing =
      fitted * *each + static_cast<double>(phases[phase].held_out.size()) * look_seconds + seconds_of_reads(fitted);
  const long more = at / 3;
  const long rounds = (at + more) / recipe.measure_every - at / recipe.measure_every;
  const double refitting = static_cast<double>(more) * *each + static_cast<double>(rounds) *
                                                                   static_cast<double>(phases[phase].held_out.size()) *
                                                                   look_seconds;
  // As many draws of every picture again at the end: see seconds_of_next().
  if (until_now + 2 * reducing + refitting < request.seconds) return;
  if (refitting > reducing)
    phase_steps = std::min(phase_steps, at + more);
  else
    recipe.consolidate = 1;
}

// The waits for pictures in the next `steps` steps: once for each that is not on the device. Where they do not all stay
// there, one wait each time.
double SceneFit::Impl::seconds_of_reads(double steps) const {
  if (reads == 0) return 0;
  const auto all = static_cast<double>(phases[phase].views.size());
  double missing = 0;
  for (const int view : phases[phase].views) missing += resident.count(view) == 0 ? 1 : 0;
  const double more =
      static_cast<double>(fitter->steps_done()) < all ? std::min(steps, missing) : steps * missing / all;
  return more * waited / static_cast<double>(reads);
}

bool SceneFit::Impl::has_time_for(double rounds) const {
  return request.seconds <= 0 || request.seconds - seconds > rounds * (seconds - phase_began);
}

}  // namespace vsplat

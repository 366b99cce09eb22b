#include "model/fit/scene_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "model/base/merged_gaussians.h"
#include "model/base/resample.h"
#include "model/base/scene_edit.h"
#include "model/fit/beside_cube.h"
#include "model/fit/fit_checkpoint.h"
#include "model/fit/outliers.h"
#include "model/fit/scene_fit_impl.h"
#include "model/views/view_choice.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/profile/profiler.h"
#include "runtime/system/host_memory.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

constexpr std::size_t kCacheOfHost = 4;  // share of the host's memory for pictures before the fit is planned
constexpr std::size_t kEvery = 8;        // with many views, one in so many is held out
constexpr int kHoldsOut = 5;             // views of a whole scene from which on one is held out
constexpr std::size_t kLookedAt = 8;     // pictures sampled to represent all
constexpr long kUnmeasuredSteps = 100;   // limit for few views of which none is held out
constexpr int kFalls = 2;                // a fold ends when its PSNR has fallen so often in a row
constexpr double kLastPhase = 1.25;      // time reserved for the phase after the folds, in folds

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begun) { return std::chrono::duration<double>(Clock::now() - begun).count(); }

// `count` elements of `all`, evenly spread.
std::vector<int> spread(const std::vector<int>& all, int count) {
  std::vector<int> out;
  for (long i = 0; i < count; ++i)
    out.push_back(all[static_cast<std::size_t>((2 * i + 1) * static_cast<long>(all.size()) / (2L * count))]);
  return out;
}

std::vector<int> without(const std::vector<int>& all, const std::vector<int>& some) {
  std::vector<int> out;
  for (const int view : all)
    if (std::find(some.begin(), some.end(), view) == some.end()) out.push_back(view);
  return out;
}

std::vector<int> held_out_views(const ViewSet& set, const std::vector<int>& used, const FitRequest& request) {
  using Kind = FitHoldout::Kind;
  const FitHoldout& holdout = request.holdout;
  const int n = static_cast<int>(used.size());
  const int least = request.whole ? kHoldsOut : kManyViews;
  if (holdout.kind == Kind::none || (holdout.kind == Kind::automatic && n < least)) return {};
  if (holdout.kind == Kind::automatic) {
    const std::vector<int> others = without(used, request.spared);
    std::vector<int> out;
    for (std::size_t i = 0; i < others.size(); i += kEvery) out.push_back(others[i]);
    return out;
  }
  if (holdout.kind == Kind::named) {
    const std::vector<int> out = listed_views(set, holdout.names, Option::holdout_names);
    for (const int view : out)
      if (std::find(used.begin(), used.end(), view) == used.end())
        fail(Status::usage, "{}: {} is not among the views that are used", Option::holdout_names,
             set.views[static_cast<std::size_t>(view)].name);
    return out;
  }
  if (holdout.count < 1 || holdout.count >= n)
    fail(Status::usage, "{} is {}: of {} views 1 to {} can be held out", Option::holdout_count, holdout.count, n,
         n - 1);
  return spread(used, holdout.count);
}

bool is_worse(const std::pair<const long, Measured>& a, const std::pair<const long, Measured>& b) {
  return mean(a.second).psnr < mean(b.second).psnr;
}

}  // namespace

FitScore mean(const Measured& j) {
  if (j.pictures == 0) return {std::nan(""), std::nan("")};
  return {j.psnr / j.pictures, j.ssim / j.pictures};
}

SceneFit::Impl::Impl(Context& c, const Photographs& p, FitStart s, FitRequest r)
    : ctx(c),
      photographs(p),
      given(std::move(s)),
      request(std::move(r)),
      to_world{given.placement.edge, Eigen::Matrix3d::Identity(), given.placement.centre},
      pictures(p, to_world, request.longest, std::min(kMostCached, host_memory_limit() / kCacheOfHost),
               request.depth_kind == DepthKind::metric) {
  const auto begun = Clock::now();
  if (request.antialias)
    given.make = [make = std::move(given.make)](const std::vector<int>& views) {
      Scene out = make(views);
      out.antialias = true;
      return out;
    };
  used = listed_views(p.set, request.names, Option::fit_views);
  if (request.consolidate > 0 && request.consolidate < 1 && used.size() < kManyViews && !request.whole)
    fail(Status::usage, "a consolidation needs {} views or more, {} are used", kManyViews, used.size());
  check_masks();
  const std::vector<int> to_measure = held_out_views(p.set, used, request);
  const std::vector<int> fitted = without(used, to_measure);
  if (fitted.empty()) fail(Status::usage, "every view is held out: there is none to fit to");
  const bool folds = request.holdout.kind == FitHoldout::Kind::automatic && to_measure.empty() && !request.whole;
  if (folds && used.size() > 1)
    for (std::size_t i = 0; i < used.size(); ++i)
      phases.push_back({fmt::format("leaving out {} of {}", i + 1, used.size()), without(used, {used[i]}), {used[i]}});
  phases.push_back({"fitting", fitted, to_measure});
  held_out = folds && used.size() > 1 ? used : to_measure;
  // A single view cannot be left out, so the effect of further steps is unknown.
  unknown = folds && used.size() == 1;
  std::optional<FitCheckpoint> from;
  if (!request.checkpoint.empty()) {
    request_text = text_of_request();
    lock.emplace(request.checkpoint);
    from = load_fit_checkpoint(request.checkpoint, request_text);
  }
  if (from && !request.resume)
    fail(Status::usage, "{}: holds the state of a fit already; {} continues it, another folder begins again",
         fit_checkpoint_path(request.checkpoint), Option::fit_resume);
  if (!request.whole) warn_of_background();
  if (from)
    go_on(*from);
  else
    begin_phase();
  seconds += seconds_since(begun);
}

void SceneFit::Impl::warn_of_background() {
  std::vector<double> shares;
  const std::size_t unmasked = used.size() - masked;
  if (unmasked == 0) return;
  for (const int view : spread(used, static_cast<int>(std::min(used.size(), kLookedAt))))
    shares.push_back(shown_beside_cube(*pictures.at(view), given.cube, measured_over(request.background)));
  if (const std::string text = doubts_about_cube(shares, unmasked, used.size()); !text.empty()) warn("{}", text);
}

ShownObject SceneFit::Impl::shown_object(const std::vector<int>& views) {
  const std::vector<int> some = spread(views, static_cast<int>(std::min(views.size(), kLookedAt)));
  const auto count = static_cast<double>(some.size());
  ShownObject out{0, 0};
  for (const int view : some) {
    const std::shared_ptr<const FitPicture> picture = pictures.at(view);
    double pixels = 0;
    for (std::size_t i = 3; i < picture->rgba.size(); i += 4) pixels += picture->rgba[i] / 255.0;
    const Camera& camera = picture->camera;
    out.pixels += pixels / count;
    out.width += camera.centre().norm() * std::sqrt(pixels / (camera.fx * camera.fy)) / count;
  }
  return out;
}

void SceneFit::Impl::begin_phase() {
  const Phase& now = phases[phase];
  Scene scene = !in_folds() && first ? *first : given.make(now.views);
  if (scene.gaussians.count == 0) fail(Status::input, "the start has no Gaussian: there is nothing to fit");
  if (scene.gaussians.kind != GaussianKind::volume)
    fail(Status::usage, "the start's Gaussians are surfels: only those of three scales can be fitted");
  if (!in_folds()) first = scene;
  transform(scene, to_world.inverse());
  const ShownObject shown = shown_object(now.views);
  if (given.predicted != Predicted::no && used.size() >= kManyViews)
    scene.gaussians = merged_gaussians(scene.gaussians, merged_count(request, shown.pixels));
  recipe = fit_recipe(request, static_cast<long>(used.size()), shown, static_cast<long>(scene.gaussians.count),
                      given.predicted);
  recipe.options.antialias = scene.antialias;
  recipe.options.sky = sky_sphere();
  degree = request.degree.value_or(std::max(scene.gaussians.drawn_degree(), recipe.least_degree));
  if (scene.gaussians.sh_degree > kDrawnDegree && phase == 0)
    warn("the start's spherical harmonics have degree {}: the fit has those of up to degree {}",
         scene.gaussians.sh_degree, degree);
  set_degree(scene.gaussians, degree);
  const Gaussians start = std::move(scene.gaussians);
  if (phases.size() == 1 && now.held_out.empty() && request.steps == 0 && used.size() < kManyViews && !request.whole)
    recipe.steps = std::min(recipe.steps, kUnmeasuredSteps);
  phase_steps = recipe.steps;
  if (in_folds() && request.steps > 0)
    recipe.measure_every = request.steps;  // measure only after the requested number of steps
  if (unknown) phase_steps = 0;
  if (in_folds() && phase > 0)
    phase_steps = std::min(phase_steps, measured_by_all(phase));  // later steps are not compared
  if (phases.size() > 1 && !in_folds()) {                         // as many steps as were best in the folds
    const auto rounds = curve.empty() ? 0 : static_cast<std::size_t>(curve.begin()->second.pictures);
    held_out.assign(used.begin(), used.begin() + static_cast<std::ptrdiff_t>(rounds));
    std::erase_if(curve, [most = measured_by_all(rounds)](const auto& at) { return at.first > most; });
    phase_steps = curve.empty() ? 0 : std::max_element(curve.begin(), curve.end(), is_worse)->first;
  }
  last_psnr = std::nan("");
  falls = 0;
  fitter.reset();  // frees its memory before the next is allocated
  poses.clear();
  exposures.clear();
  resident.clear();
  resident_bytes = 0;
  held = {};
  ctx.memory().trim();  // plans begin with what is left
  const Camera largest = pictures.largest(used);
  limit_growth(start, scene.near, largest);
  budget = fit_budget(ctx, start, scene.near, recipe.options, largest);
  pictures.limit(budget.on_host);
  hold_host_memory();
  if (!resuming) pairs = static_cast<long>(budget.pairs);
  recipe.options.most_pairs = static_cast<std::uint64_t>(pairs);
  largest_pixels = static_cast<double>(largest.width) * largest.height;
  fitter = std::make_unique<Fitter>(ctx, start, scene.near, scene.mirror, recipe.options);
  if (recipe.options.antialias) fitter->set_cameras(pictures.cameras(now.views));
  phase_began = seconds;  // not before: what is above may throw, and is then begun again
  if (resuming) return;
  const Uncancelled whole(ctx);
  record_measurement();
  if (phase_steps == 0) end_phase();
}

// Unless a number of Gaussians was asked for, it grows no further than memory allows; when resumed, as it would have.
void SceneFit::Impl::limit_growth(const Gaussians& start, float near, const Camera& largest) {
  if (request.max_gaussians > 0 || recipe.options.grow_every == 0) return;
  const long wanted = recipe.options.max_gaussians;
  const long most = resuming ? grows_to : affordable_gaussians(ctx, start, near, recipe.options, largest);
  const ArenaLimits& limits = ctx.memory().limits();
  if (most < wanted && !resuming && limits.on_host)
    warn("the scene grows to {} Gaussians, as many as {:.4g} GiB of memory allow ({}, {}), not to {}", most,
         gib(std::min(limits.total, host_memory_limit())), Option::max_memory, Option::max_host_memory, wanted);
  else if (most < wanted && !resuming)
    warn("the scene grows to {} Gaussians, as many as {:.4g} GiB of device memory allow ({}), not to {}", most,
         gib(limits.total), Option::max_memory, wanted);
  grow_to(recipe, most, static_cast<long>(start.count));
  grows_to = most;
}

// No drawing takes the memory of scenes and pictures, nor that for reading one.
void SceneFit::Impl::hold_host_memory() {
  const double most = static_cast<double>(host_memory_limit()) - static_cast<double>(reserved_host_memory());
  held = HostMemory("a fit", std::clamp(budget.host + static_cast<double>(budget.on_host), 0.0, std::max(most, 0.0)));
}

// The largest number of steps that all of the first `rounds` folds have measured.
long SceneFit::Impl::measured_by_all(std::size_t rounds) const {
  long out = 0;
  for (const auto& [at, sum] : curve)
    if (static_cast<std::size_t>(sum.pictures) >= rounds) out = at;
  return out;
}

Measured SceneFit::Impl::measure_held_out() {
  const Phase& now = phases[phase];
  const long compilations = ctx.profiler().compilations();
  Measured here;
  double took = 0;
  with_each(now.held_out, [&](int view) {
    const DeviceFitPicture& picture = on_device(view);
    if (picture.known_share == 0)
      fail(Status::input, "{}: no pixel of it is inside its mask, so nothing can be measured on it: leave it out of {}",
           photographs.set.views[static_cast<std::size_t>(view)].name, Option::holdout_names);
    const auto begun = Clock::now();
    const FitScore score = fitter->score(picture);
    took += seconds_since(begun);
    here.psnr += score.psnr;
    here.ssim += score.ssim;
    ++here.pictures;
  });
  // Compilation, like the reading of pictures, is not repeated.
  if (here.pictures > 0 && ctx.profiler().compilations() == compilations) look_seconds = took / here.pictures;
  return here;
}

void SceneFit::Impl::record_measurement() {
  const long at = fitter->steps_done();
  const Measured here = measure_held_out();
  if (here.pictures == 0) return;
  const Uncancelled whole(ctx);
  falls = mean(here).psnr < last_psnr ? falls + 1 : 0;
  last_psnr = mean(here).psnr;
  Measured& sum = curve[at];
  sum.psnr += here.psnr;
  sum.ssim += here.ssim;
  sum.pictures += here.pictures;
  if (in_folds() || request.whole) return;
  if (at > 0 && last_psnr > mean(curve.at(best_steps)).psnr) {
    best = fitter->gaussians();
    best_steps = at;
  }
}

bool SceneFit::Impl::step() {
  if (done) return false;
  const auto begun = Clock::now();
  const double before = waited, behind = std::exchange(report_delay, 0.0);
  seconds += behind;
  if (!left) {
    if (consolidates_now()) consolidate();
    const int view = view_of_step(fitter->steps_done());
    const DeviceFitPicture picture = corrected(view);  // takes what was read ahead
    read_ahead_of_steps();
    step_on(view, picture);
    const double took = behind + seconds_since(begun);
    step_seconds = last_step > 0 ? std::min(took, last_step) : 0;
    last_step = took;
    pace.add(took - (waited - before), ctx.profiler().compilations());
    ++steps_in_all;
    const long at = fitter->steps_done();
    left = AfterStep{at % recipe.measure_every == 0 || at == phase_steps, false, at >= phase_steps};
  }
  const bool look = left->measures;
  follow(*left);
  left.reset();
  const double until_now = seconds + seconds_since(begun);
  if (!done && request.seconds > 0 && consolidates() && !is_consolidated()) leave_time_to_consolidate(until_now);
  if (!done && request.seconds > 0 && until_now + seconds_of_next() >= request.seconds) finish();
  seconds += seconds_since(begun);
  if (look && !request.checkpoint.empty()) save();
  return !done;
}

bool SceneFit::Impl::consolidates_now() const {
  const long at = fitter->steps_done();
  return consolidates() && !is_consolidated() && at + at / 3 >= phase_steps;
}

void SceneFit::Impl::follow(AfterStep& after) {
  if (after.measures && !after.measured) record_measurement();
  after.measured = true;
  if (in_folds() && (falls >= kFalls || (after.measures && !has_time_for(kLastPhase)))) after.ends = true;
  if (after.ends) end_phase();
}

void SceneFit::Impl::end_phase() {
  if (!in_folds()) return finish();
  const std::size_t before = phase;
  phase = has_time_for(1 + kLastPhase) ? phase + 1 : phases.size() - 1;
  try {
    begin_phase();
  } catch (...) {
    phase = before;  // the phase starts again
    throw;
  }
}

// Ends the last phase in its current state; phases that have not begun are skipped.
void SceneFit::Impl::finish() {
  if (done) return;
  if (!in_folds()) {
    if ((request.whole || phases[phase].held_out.empty()) && fitter->steps_done() > 0 && !pruned && !unreduced) {
      best = fitter->gaussians();
      best_steps = fitter->steps_done();
    }
    prune();
    std::vector<FitScore> scores;
    if (fitter->steps_done() > 0)
      with_each(phases[phase].views, [&](int view) { scores.push_back(fitter->score(corrected(view))); });
    for (const std::size_t i : find_outliers(scores)) outliers.push_back(phases[phase].views[i]);
    if (best && request.background.kind == FitBackground::Kind::sky && !phases[phase].held_out.empty())
      written = score_written();
  }
  done = true;
  resident.clear();  // leaves memory for what is done with the result
  resident_bytes = 0;
  passing = {};
  pictures.limit(0);
  held = {};
  ctx.memory().trim();
}

Scene SceneFit::Impl::to_scene(const Gaussians& gaussians) const {
  Scene out;
  out.gaussians = gaussians;
  transform(out, to_world, first->offset);
  out.near = first->near;
  out.mirror = first->mirror;
  out.antialias = first->antialias;
  out.up = first->up;
  return out;
}

SceneFit::SceneFit(Context& ctx, const Photographs& photographs, FitStart start, FitRequest request)
    : impl_(std::make_unique<Impl>(ctx, photographs, std::move(start), std::move(request))) {}
SceneFit::~SceneFit() = default;

bool SceneFit::step() { return impl_->step(); }

void SceneFit::stop() { impl_->finish(); }

FitProgress SceneFit::progress() const {
  const Impl& i = *impl_;
  FitProgress out;
  out.phase = i.is_consolidated() ? "consolidating" : i.phases[i.phase].name;
  out.step = i.fitter->steps_done();
  out.steps = i.phase_steps;
  out.gaussians = i.fitter->count();
  if (out.step > 0) {
    const auto begun = Clock::now();
    out.loss = static_cast<double>(i.ctx.read<float>(i.fitter->last_loss())[0]);
    impl_->report_delay += seconds_since(begun);
  }
  out.psnr = i.last_psnr;
  out.seconds_left = i.seconds_left();
  if (i.request.seconds > 0) out.seconds_left = std::min(out.seconds_left, i.request.seconds - i.seconds);
  return out;
}

// Whether the scene as it is now is the best one of a fit in progress.
bool SceneFit::Impl::latest_is_best() const {
  return !done && !in_folds() && (request.whole || phases[phase].held_out.empty()) && fitter->steps_done() > 0;
}

FitResult SceneFit::figures() const {
  const Impl& i = *impl_;
  FitResult out;
  out.seconds = i.seconds;
  out.in_turn = i.phases.size() > 1;
  out.background = measured_over(i.request.background);
  out.held_out = i.held_out;
  out.outliers = i.outliers;
  out.start = out.result = out.over_sky = {std::nan(""), std::nan("")};
  bool made = i.best || i.latest_is_best();
  out.steps = i.latest_is_best() ? i.fitter->steps_done() : i.best_steps;
  // While folds run, only some of the views have been measured.
  if (i.done && i.in_folds()) out.held_out.clear();
  if (!i.held_out.empty() && !i.in_folds()) {
    out.start = mean(i.curve.at(0));
    out.result = mean(std::prev(i.curve.upper_bound(out.steps))->second);
    if (!(out.result.psnr > out.start.psnr)) {
      made = false;
      // The best of the fitted scenes.
      const auto later = std::next(i.curve.begin());
      if (later != i.curve.end()) out.result = mean(std::max_element(later, i.curve.end(), is_worse)->second);
    } else if (i.written) {
      out.over_sky = std::exchange(out.result, *i.written);
    }
  }
  out.start_returned = !made;
  if (!made) out.steps = 0;
  return out;
}

FitResult SceneFit::result() {
  Impl& i = *impl_;
  FitResult out = figures();
  if (out.start_returned)
    out.scene = start();
  else
    out.scene = i.to_scene(i.latest_is_best() ? i.fitter->gaussians() : *i.best);
  return out;
}

const FitBudget& SceneFit::memory() const { return impl_->budget; }

const Scene& SceneFit::start() const {
  Impl& i = *impl_;
  if (!i.first) i.first = i.given.make(i.phases.back().views);
  return *i.first;
}

Image SceneFit::picture(int view) {
  const std::shared_ptr<const FitPicture> picture = impl_->pictures.at(view);
  Image out(picture->camera.width, picture->camera.height, 4);
  for (std::size_t k = 0; k < out.data.size(); ++k) out.data[k] = static_cast<float>(picture->rgba[k]) / 255.0f;
  return over(out, measured_over(impl_->request.background));
}

Camera SceneFit::camera(int view) { return to_frame(impl_->corrected_camera(view), impl_->to_world.inverse()); }

}  // namespace vsplat

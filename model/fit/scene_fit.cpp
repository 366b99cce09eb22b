#include "model/fit/scene_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "model/base/resample.h"
#include "model/base/rng.h"
#include "model/fit/fit_checkpoint.h"
#include "model/fit/fit_pictures.h"
#include "model/fit/fit_plan.h"
#include "model/fit/fit_recipe.h"
#include "model/fit/suspects.h"
#include "model/fit/view_corrections.h"
#include "model/input/view_choice.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr std::size_t kPictureCap = std::size_t{2} << 30;  // bytes of decoded pictures
constexpr int kEvery = 8;                                  // of many views one in so many is held out
constexpr double kPoseRate = 3e-4, kExposureRate = 2e-3;   // of Adam, falling to a tenth over a leg
constexpr long kUnjudgedSteps = 100;                       // of few views of which none is held out

// A fit to some views, judged by others.
struct Leg {
  std::string phase;
  std::vector<int> views, judges;
};

Gaussians with_degree(Gaussians g, int degree) {
  if (degree == g.sh_degree) return g;
  const std::size_t from = 3 * g.sh_count(), to = 3 * static_cast<std::size_t>((degree + 1) * (degree + 1));
  std::vector<float> sh(g.count * to, 0.0f);
  for (std::size_t k = 0; k < g.count; ++k) std::copy_n(&g.sh[k * from], std::min(from, to), &sh[k * to]);
  g.sh = std::move(sh);
  g.sh_degree = degree;
  return g;
}

// `count` of `all`, evenly spread.
std::vector<int> spread(const std::vector<int>& all, int count) {
  std::vector<int> out;
  for (long i = 0; i < count; ++i)
    out.push_back(all[static_cast<std::size_t>((2 * i + 1) * static_cast<long>(all.size()) / (2L * count))]);
  return out;
}

std::vector<int> held_out(const ViewSet& set, const std::vector<int>& used, const FitHoldout& holdout) {
  using Kind = FitHoldout::Kind;
  const int n = static_cast<int>(used.size());
  if (holdout.kind == Kind::none || (holdout.kind == Kind::automatic && n < kManyViews)) return {};
  if (holdout.kind == Kind::automatic) {
    std::vector<int> out;
    for (int i = 0; i < n; i += kEvery) out.push_back(used[static_cast<std::size_t>(i)]);
    return out;
  }
  if (holdout.kind == Kind::named) {
    const std::vector<int> out = listed_views(set, holdout.names, "vsplat_refine_options.holdout_names");
    for (const int view : out)
      if (std::find(used.begin(), used.end(), view) == used.end())
        fail(Status::usage, "vsplat_refine_options.holdout_names: {} is not among the views that are used",
             set.views[static_cast<std::size_t>(view)].name);
    return out;
  }
  if (holdout.count < 1 || holdout.count >= n)
    fail(Status::usage, "vsplat_refine_options.holdout_count is {}: of {} views 1 to {} can be held out", holdout.count,
         n, n - 1);
  return spread(used, holdout.count);
}

std::vector<int> without(const std::vector<int>& all, const std::vector<int>& some) {
  std::vector<int> out;
  for (const int view : all)
    if (std::find(some.begin(), some.end(), view) == some.end()) out.push_back(view);
  return out;
}

// What has been seen so far of a number of steps.
struct Judged {
  double psnr = 0, ssim = 0;  // sums
  int pictures = 0;
};

FitScore mean(const Judged& j) {
  if (j.pictures == 0) return {std::nan(""), std::nan("")};
  return {j.psnr / j.pictures, j.ssim / j.pictures};
}

}  // namespace

struct SceneFit::Impl {
  Impl(Context& c, const Photographs& p, FitStart s, FitRequest r);

  bool step();
  void finish();
  void begin_leg();
  void end_leg();
  void judge();
  const DeviceFitPicture& on_device(int view);
  DeviceFitPicture corrected(int view);
  void step_on(int view);
  int view_of_step(long step) const;
  double object_pixels(const std::vector<int>& views);
  Scene to_scene(const Gaussians& gaussians) const;
  std::string text_of_request() const;
  void save() const;
  void go_on(const FitCheckpoint& from);
  bool in_folds() const { return leg + 1 < legs.size(); }

  Context& ctx;
  const Photographs& photographs;
  FitStart given;
  FitRequest request;
  std::string request_text;  // where there is a checkpoint
  Similarity to_world;
  FitPictures pictures;
  std::vector<int> used;

  std::vector<Leg> legs;  // the last fits what is returned; those before leave one view out each
  std::size_t leg = 0;
  FitRecipe recipe;
  long leg_steps = 0;
  std::unique_ptr<Fitter> fitter;  // of the leg
  std::optional<Scene> first;      // in the world: what the last leg begins with
  std::map<long, Judged> curve;    // by steps, over the folds or over the held-out pictures
  std::vector<int> judged;
  std::map<int, PoseCorrection> poses;  // of the leg, where they are asked for
  std::map<int, ExposureCorrection> exposures;
  std::map<int, DeviceFitPicture> resident;
  DeviceFitPicture passing;
  std::size_t resident_bytes = 0;

  bool done = false, wants_start = false, resuming = false;
  double seconds = 0, last_psnr = std::nan("");
  long steps_in_all = 0;
  // The best of the last leg.
  std::optional<Gaussians> best;
  long best_steps = 0;
  std::vector<int> suspects;
};

SceneFit::Impl::Impl(Context& c, const Photographs& p, FitStart s, FitRequest r)
    : ctx(c),
      photographs(p),
      given(std::move(s)),
      request(std::move(r)),
      to_world{given.placement.edge, Eigen::Matrix3d::Identity(), given.placement.centre},
      pictures(p, to_world, request.longest, kPictureCap) {
  used = listed_views(p.set, request.names, "vsplat_refine_options.names");
  const std::vector<int> held = held_out(p.set, used, request.holdout);
  const std::vector<int> fitted = without(used, held);
  if (fitted.empty()) fail(Status::usage, "every view is held out: there is none to fit to");
  const bool folds = request.holdout.kind == FitHoldout::Kind::automatic && held.empty();
  if (folds && used.size() > 1)
    for (std::size_t i = 0; i < used.size(); ++i)
      legs.push_back({fmt::format("leaving out {} of {}", i + 1, used.size()), without(used, {used[i]}), {used[i]}});
  legs.push_back({"refining", fitted, held});
  judged = folds && used.size() > 1 ? used : held;
  // A single view: nothing can be left out, and nothing is known of what steps would do.
  wants_start = folds && used.size() == 1;
  std::optional<FitCheckpoint> from;
  if (!request.checkpoint.empty()) {
    request_text = text_of_request();
    from = load_fit_checkpoint(request.checkpoint, request_text);
  }
  if (from && !request.resume)
    fail(Status::usage,
         "{}: there is the state of a refinement already; vsplat_refine_options.resume goes on with it, another folder "
         "begins anew",
         fit_checkpoint_path(request.checkpoint));
  if (from)
    go_on(*from);
  else
    begin_leg();
}

double SceneFit::Impl::object_pixels(const std::vector<int>& views) {
  const std::vector<int> some = spread(views, static_cast<int>(std::min<std::size_t>(views.size(), 8)));
  double sum = 0;
  for (const int view : some) {
    const std::shared_ptr<const FitPicture> picture = pictures.at(view);
    for (std::size_t i = 3; i < picture->rgba.size(); i += 4) sum += picture->rgba[i] / 255.0;
  }
  return sum / static_cast<double>(some.size());
}

void SceneFit::Impl::begin_leg() {
  const Leg& now = legs[leg];
  Scene scene = given.make(now.views);
  if (scene.gaussians.count == 0) fail(Status::input, "the start has no Gaussian: there is nothing to refine");
  if (!in_folds()) first = scene;
  transform(scene, to_world.inverse());
  recipe = fit_recipe(request, static_cast<long>(used.size()), object_pixels(now.views),
                      static_cast<long>(scene.gaussians.count));
  const int degree = request.degree.value_or(std::max(scene.gaussians.sh_degree, recipe.least_degree));
  const Gaussians start = with_degree(std::move(scene.gaussians), degree);
  leg_steps = recipe.steps;
  if (in_folds() && request.steps > 0) recipe.judge_every = request.steps;  // that number or none
  if (wants_start) leg_steps = 0;
  if (legs.size() == 1 && now.judges.empty() && request.steps == 0 && used.size() < kManyViews)
    leg_steps = std::min(leg_steps, kUnjudgedSteps);
  if (legs.size() > 1 && !in_folds()) {  // as many steps as the folds were best with
    const auto better = [](const auto& a, const auto& b) { return mean(a.second).psnr < mean(b.second).psnr; };
    leg_steps = curve.empty() ? 0 : std::max_element(curve.begin(), curve.end(), better)->first;
    wants_start = leg_steps == 0;
  }
  last_psnr = std::nan("");
  fitter.reset();  // its memory goes first
  poses.clear();
  exposures.clear();
  resident.clear();
  resident_bytes = 0;
  const std::shared_ptr<const FitPicture> any = pictures.at(now.views.front());
  expect_room(ctx, start, scene.near, recipe.options, any->camera);
  fitter = std::make_unique<Fitter>(ctx, start, scene.near, scene.mirror, recipe.options);
  if (resuming) return;
  judge();
  if (leg_steps == 0) end_leg();
}

const DeviceFitPicture& SceneFit::Impl::on_device(int view) {
  const auto there = resident.find(view);
  if (there != resident.end()) return there->second;
  const std::shared_ptr<const FitPicture> picture = pictures.at(view);
  const std::size_t bytes = picture->rgba.size() + picture->known.size();
  if (resident_bytes + bytes > ctx.memory().limits().total / 4) {
    passing = {};
    passing = upload(ctx, *picture);
    return passing;
  }
  resident_bytes += bytes;
  return resident.emplace(view, upload(ctx, *picture)).first->second;
}

// With the camera as it has been learnt.
DeviceFitPicture SceneFit::Impl::corrected(int view) {
  DeviceFitPicture out = on_device(view);
  if (const auto pose = poses.find(view); pose != poses.end()) out.camera.w2c = pose->second.w2c();
  return out;
}

// One step of the scene, and of what is learnt of the view beside it.
void SceneFit::Impl::step_on(int view) {
  const DeviceFitPicture picture = corrected(view);
  const double fall = std::pow(0.1, static_cast<double>(fitter->steps_done()) / static_cast<double>(leg_steps));
  std::array<double, 6> dpose{};
  FitAside aside;
  if (request.poses) aside.dpose = &dpose;
  if (request.exposure) {
    const ExposureCorrection& exposure = exposures.try_emplace(view, make_exposure(ctx)).first->second;
    aside.exposure = exposure.map.reshaped({12});
    aside.dexposure = exposure.gradient.reshaped({12});
  }
  fitter->step(picture, aside);
  if (request.poses) poses.try_emplace(view, picture.camera.w2c).first->second.move(dpose, kPoseRate * fall);
  if (request.exposure) move(ctx, exposures.at(view), kExposureRate * fall);
}

// Each epoch sees every view once, in an order of its own.
int SceneFit::Impl::view_of_step(long step) const {
  const std::vector<int>& views = legs[leg].views;
  const auto n = static_cast<long>(views.size());
  const auto epoch = static_cast<std::uint32_t>(step / n);
  std::vector<int> order = views;
  for (std::size_t i = order.size() - 1; i > 0; --i) {
    const auto random =
        philox4x32_10({static_cast<std::uint32_t>(i), epoch, stream_of("fit.order"), 0}, rng_key(request.seed));
    std::swap(order[i], order[random[0] % (i + 1)]);
  }
  return order[static_cast<std::size_t>(step % n)];
}

void SceneFit::Impl::judge() {
  const Leg& now = legs[leg];
  const long at = fitter->steps_done();
  Judged here;
  for (const int view : now.judges) {
    const FitScore score = fitter->judge(on_device(view));
    here.psnr += score.psnr;
    here.ssim += score.ssim;
    ++here.pictures;
  }
  if (here.pictures == 0) return;
  last_psnr = mean(here).psnr;
  Judged& sum = curve[at];
  sum.psnr += here.psnr;
  sum.ssim += here.ssim;
  sum.pictures += here.pictures;
  if (in_folds()) return;
  if (at > 0 && last_psnr > mean(curve.at(best_steps)).psnr) {
    best = fitter->gaussians();
    best_steps = at;
  }
}

bool SceneFit::Impl::step() {
  if (done) return false;
  const auto begun = std::chrono::steady_clock::now();
  step_on(view_of_step(fitter->steps_done()));
  ++steps_in_all;
  const long at = fitter->steps_done();
  const bool look = at % recipe.judge_every == 0 || at == leg_steps;
  if (look) judge();
  if (at >= leg_steps) end_leg();
  seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  if (!done && request.seconds > 0 && seconds >= request.seconds) finish();
  if (look && !request.checkpoint.empty()) save();
  return !done;
}

// What makes a refinement the same one: all that its bits depend on, but the pixels.
std::string SceneFit::Impl::text_of_request() const {
  const FitRequest& r = request;
  std::string out = fmt::format(
      "steps {} max_gaussians {} degree {} longest {} freeze {}{}{}{}{} poses {} exposure {} seed {} centre {} {} {} "
      "edge {}",
      r.steps, r.max_gaussians, r.degree.value_or(-1), r.longest, r.freeze.means, r.freeze.scales, r.freeze.rotations,
      r.freeze.opacities, r.freeze.sh, r.poses, r.exposure, r.seed, exact_text(given.placement.centre.x()),
      exact_text(given.placement.centre.y()), exact_text(given.placement.centre.z()), exact_text(given.placement.edge));
  for (const Leg& each : legs) {
    out += " |";
    for (const int view : each.views)
      out += fmt::format(" {}", photographs.set.views[static_cast<std::size_t>(view)].name);
    out += " judged by";
    for (const int view : each.judges)
      out += fmt::format(" {}", photographs.set.views[static_cast<std::size_t>(view)].name);
  }
  const Scene start = given.make(legs.back().views);
  std::uint32_t sum = stream_of("");
  for (const std::vector<float>* values : {&start.gaussians.means, &start.gaussians.scales, &start.gaussians.quats,
                                           &start.gaussians.opacities, &start.gaussians.sh})
    sum = sum * 31 + stream_of({reinterpret_cast<const char*>(values->data()), values->size() * sizeof(float)});
  return out + fmt::format(" | start of {} Gaussians, {:08x}", start.gaussians.count, sum);
}

void SceneFit::Impl::save() const {
  FitCheckpoint out;
  out.request = request_text;
  out.tensors = fitter->state();
  const auto keep = [&](const char* name, const Shape& shape, const std::vector<float>& data) {
    out.tensors[std::string("best.") + name] = {shape, data};
  };
  if (best) {
    const auto n = static_cast<long>(best->count);
    keep("means", {n, 3}, best->means);
    keep("scales", {n, 3}, best->scales);
    keep("quats", {n, 4}, best->quats);
    keep("opacities", {n}, best->opacities);
    keep("sh", {n, static_cast<long>(best->sh_count()), 3}, best->sh);
    out.state["best_degree"] = std::to_string(best->sh_degree);
  }
  out.state["leg"] = std::to_string(leg);
  out.state["steps"] = std::to_string(fitter->steps_done());
  out.state["leg_steps"] = std::to_string(leg_steps);
  out.state["best_steps"] = std::to_string(best_steps);
  out.state["steps_in_all"] = std::to_string(steps_in_all);
  out.state["seconds"] = exact_text(seconds);
  out.state["last_psnr"] = exact_text(last_psnr);
  for (const auto& [at, sum] : curve) {
    const std::string name = fmt::format("curve.{}", at);
    out.state[name + ".psnr"] = exact_text(sum.psnr);
    out.state[name + ".ssim"] = exact_text(sum.ssim);
    out.state[name + ".pictures"] = std::to_string(sum.pictures);
  }
  for (const auto& [view, pose] : poses) out.state[fmt::format("pose.{}", view)] = pose.text();
  for (const auto& [view, exposure] : exposures) put(ctx, exposure, fmt::format("exposure.{}", view), out);
  save_fit_checkpoint(request.checkpoint, out);
}

void SceneFit::Impl::go_on(const FitCheckpoint& from) {
  leg = static_cast<std::size_t>(whole_number(from, "leg"));
  if (leg >= legs.size())
    fail(Status::format, "a refinement's state is of leg {}, of which there are {}", leg, legs.size());
  for (const auto& [name, text] : from.state) {
    long at = 0;
    if (std::sscanf(name.c_str(), "curve.%ld.psnr", &at) != 1 || !name.ends_with(".psnr")) continue;
    const std::string stem = name.substr(0, name.size() - 5);
    curve[at] = {number(from, stem + ".psnr"), number(from, stem + ".ssim"),
                 static_cast<int>(whole_number(from, stem + ".pictures"))};
  }
  const std::map<long, Judged> judged_before = curve;
  resuming = true;
  begin_leg();
  resuming = false;
  curve = judged_before;
  leg_steps = whole_number(from, "leg_steps");
  fitter->restore(from.tensors, whole_number(from, "steps"));
  best_steps = whole_number(from, "best_steps");
  steps_in_all = whole_number(from, "steps_in_all");
  seconds = number(from, "seconds");
  last_psnr = number(from, "last_psnr");
  if (from.state.count("best_degree") > 0) {
    best.emplace();
    best->means = tensor_of(from.tensors, "best.means").data;
    best->scales = tensor_of(from.tensors, "best.scales").data;
    best->quats = tensor_of(from.tensors, "best.quats").data;
    best->opacities = tensor_of(from.tensors, "best.opacities").data;
    best->sh = tensor_of(from.tensors, "best.sh").data;
    best->count = best->opacities.size();
    best->sh_degree = static_cast<int>(whole_number(from, "best_degree"));
  }
  for (const int view : legs[leg].views) {
    const std::string pose = fmt::format("pose.{}", view), exposure = fmt::format("exposure.{}", view);
    if (from.state.count(pose) > 0) poses.emplace(view, PoseCorrection::from_text(from.state.at(pose)));
    if (from.state.count(exposure + ".steps") > 0)
      get(ctx, exposures.try_emplace(view, make_exposure(ctx)).first->second, exposure, from);
  }
  wants_start = !in_folds() && leg_steps == 0;
  if (fitter->steps_done() >= leg_steps) end_leg();
}

void SceneFit::Impl::end_leg() {
  if (in_folds()) {
    ++leg;
    begin_leg();
    return;
  }
  finish();
}

// Ends the last leg where it stands; what is not yet begun is left.
void SceneFit::Impl::finish() {
  if (done) return;
  done = true;
  if (in_folds()) {
    wants_start = true;
    return;
  }
  if (legs[leg].judges.empty() && fitter->steps_done() > 0) {
    best = fitter->gaussians();
    best_steps = fitter->steps_done();
  }
  std::vector<FitScore> scores;
  if (fitter->steps_done() > 0)
    for (const int view : legs[leg].views) scores.push_back(fitter->judge(corrected(view)));
  for (const std::size_t i : outliers(scores)) suspects.push_back(legs[leg].views[i]);
}

Scene SceneFit::Impl::to_scene(const Gaussians& gaussians) const {
  Scene out;
  out.gaussians = gaussians;
  transform(out, to_world);
  out.near = first->near;
  out.mirror = first->mirror;
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
  out.phase = i.legs[i.leg].phase;
  out.step = i.fitter->steps_done();
  out.steps = i.leg_steps;
  out.gaussians = i.fitter->count();
  if (out.step > 0) out.loss = static_cast<double>(i.ctx.read<float>(i.fitter->last_loss())[0]);
  out.psnr = i.last_psnr;
  // The folds to come, and the leg after them as if it took all its steps.
  const auto left = static_cast<double>(i.leg_steps - out.step) +
                    static_cast<double>(i.legs.size() - i.leg - 1) * static_cast<double>(i.recipe.steps);
  if (i.steps_in_all > 0 && !i.done) out.seconds_left = left * i.seconds / static_cast<double>(i.steps_in_all);
  if (i.request.seconds > 0) out.seconds_left = std::min(out.seconds_left, i.request.seconds - i.seconds);
  return out;
}

FitResult SceneFit::result() {
  Impl& i = *impl_;
  FitResult out;
  out.seconds = i.seconds;
  out.judged = i.judged;
  out.suspects = i.suspects;
  if (!i.first) i.first = i.given.make(i.legs.back().views);
  const bool judging = !i.judged.empty() && i.curve.count(0) > 0;
  if (judging) out.start = mean(i.curve.at(0));
  if (!judging) out.start = out.result = {std::nan(""), std::nan("")};
  if (judging) {
    const auto better = [](const auto& a, const auto& b) { return mean(a.second).psnr < mean(b.second).psnr; };
    const auto later = std::next(i.curve.begin());
    const auto top = later == i.curve.end() ? i.curve.begin() : std::max_element(later, i.curve.end(), better);
    out.result = mean(top->second);
  }
  // Under way without anything held out: as it stands.
  const bool as_it_stands = !i.done && !i.in_folds() && i.legs[i.leg].judges.empty() && i.fitter->steps_done() > 0;
  if (as_it_stands) {
    out.scene = i.to_scene(i.fitter->gaussians());
    out.steps = i.fitter->steps_done();
  } else if (i.best && !i.wants_start) {
    out.scene = i.to_scene(*i.best);
    out.steps = i.best_steps;
  } else {
    out.scene = *i.first;
    out.start_returned = true;
  }
  return out;
}

const Scene& SceneFit::start() const {
  Impl& i = *impl_;
  if (!i.first) i.first = i.given.make(i.legs.back().views);
  return *i.first;
}

Image SceneFit::picture(int view) {
  const std::shared_ptr<const FitPicture> picture = impl_->pictures.at(view);
  Image out(picture->camera.width, picture->camera.height, 4);
  for (std::size_t k = 0; k < out.data.size(); ++k) out.data[k] = static_cast<float>(picture->rgba[k]) / 255.0f;
  return on_white(out);
}

Camera SceneFit::camera(int view) {
  Camera camera = impl_->pictures.at(view)->camera;
  if (const auto pose = impl_->poses.find(view); pose != impl_->poses.end()) camera.w2c = pose->second.w2c();
  return to_frame(camera, impl_->to_world.inverse());
}

}  // namespace vsplat

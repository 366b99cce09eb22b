// A training's memory: allocation for an object, fallbacks if it does not fit, and plans.
#include <algorithm>
#include <cmath>
#include <limits>

#include "model/render/reserve.h"
#include "model/train/trainer.h"
#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

constexpr long kMargin = 1 << 16;  // elements reserved for rendering, in addition to its own plans

}  // namespace

// Rounds up, so that the next object probably fits, too.
long Trainer::rounded(long selected) const {
  const long all = config_.model.selectable(), unit = std::max(1L, all / 16);
  return std::min(all, (selected + unit - 1) / unit * unit);
}

void Trainer::make_memory(Context& ctx, const Network& network, const StepObject& object, PassOptions options,
                          ObjectMemory& memory) const {
  const auto count = static_cast<long>(object.given.views->cameras.size());
  if (memory.views >= count) return;
  options.forward.selection = nullptr;
  options.forward.planned_selected = memory.selected;
  options.recompute = memory.recompute;
  options.assumed_intersections = {};
  const auto run = [&](Context& c) {
    const PassViews views = upload(c, object, options);
    training_pass(c, network, views, options);
  };
  if (!memory.recompute) {  // stored activations must leave enough memory for rendering
    options.whole = true;
    run(*ctx.planner());
  }
  options.network_alone = true;
  const auto with_margin = [&](Context& c) {
    const Tensor margin = c.tensor({kMargin}, Type::f32, "margin");
    run(c);
  };
  if (!reserve_for(ctx, with_margin)) {
    const auto planner = ctx.planner();
    run(*planner);
    fail(Status::memory,
         "not enough device memory: with {} of {} {} selected and {} views a step needs {:.3f} GiB, {:.3f} GiB may "
         "be used ({}, fewer views, a smaller model or another device)",
         memory.selected, config_.model.selectable(), config_.model.selects(), count, gib(planner->memory().peak()),
         gib(ctx.memory().limits().total), Option::max_memory);
  }
  memory.views = count;
}

// First tries the previous object's memory, if no more voxels are selected; then as much as this object's voxels need;
// then the same with recomputed activations.
DrawnPass Trainer::draw_in_memory(Context& ctx, const Network& network, const StepObject& object, PassOptions options,
                                  ObjectMemory& memory, long planned) const {
  std::optional<long> selected;  // known after the coarse half
  if (!config_.model.has_fine()) selected = 0;
  bool to_measure = false;
  options.forward.planned_selected = std::max(planned, 0L);
  if (memory.views == 0) ctx.memory().trim();
  for (;;) {
    options.recompute = memory.recompute;
    try {
      make_memory(ctx, network, object, options, memory);
      const PassViews views = upload(ctx, object, options);
      Network::Half half = begin_pass(ctx, network, views, options);
      if (config_.model.has_fine()) selected = half.selected;
      if (half.selected <= memory.selected) return draw_pass(ctx, network, views, options, std::move(half));
      memory.selected = rounded(half.selected);
    } catch (const Error& e) {
      const bool smallest = to_measure && memory.recompute;
      if (e.status() != Status::memory || smallest) throw;
      if (!selected && memory.selected > 0) {
        memory.selected = 0;  // the coarse half will find it
      } else {
        memory.selected = rounded(selected.value_or(0));
        memory.recompute = to_measure;
        to_measure = true;
      }
    }
    memory.views = 0;
    ctx.memory().trim();
  }
}

bool Trainer::plan_object(Plan& out, ObjectMemory memory, long selected, std::optional<std::uint64_t> intersections,
                          bool network_alone) const {
  const long s = config_.model.image(), all = config_.inputs_max + config_.novel;
  TrainingViews views;
  views.inputs = static_cast<int>(config_.inputs_max);
  views.cameras.resize(static_cast<std::size_t>(all));
  for (Camera& camera : views.cameras) {
    camera.width = camera.height = static_cast<int>(s);
    camera.fx = camera.fy = static_cast<double>(s);
    camera.cx = camera.cy = static_cast<double>(s) / 2;
  }
  // Present but never read, so that a plan does not allocate the content.
  if (config_.alpha_weight > 0) views.rgba.assign(static_cast<std::size_t>(all), {0});
  const StepItem given{&views};
  const StepObject object{given};
  PassOptions options;
  set_loss(options, total_steps(config_.schedule));  // the last steps have the most terms
  options.assumed_intersections = intersections;
  options.network_alone = network_alone;
  std::unique_ptr<Context> for_model, ctx;
  bool ran = false;
  try {
    for_model = ctx_.planner();
    const auto network = make_network(*for_model, config_.model, weights_);
    ctx = for_model->planner();  // has the model's slabs, as in a step
    if (network_alone) {
      options.recompute = memory.recompute;
      options.forward.planned_selected = selected;
      const PassViews uploaded = upload(*ctx, object, options);
      training_pass(*ctx, *network, uploaded, options);
    } else {
      finish_pass(*ctx, *network, draw_in_memory(*ctx, *network, object, options, memory, selected));
    }
    optimiser_.move(*ctx, 1, 0, optimiser_.clipped_norm(*ctx));
    ran = true;
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    out.problem = e.what();
  }
  if (ctx) {
    out.peak = ctx->memory().peak();
    out.stages = ctx->stage_memory();
  } else {  // not even the weights fit: reports their size alone
    const auto unlimited = ctx_.planner(false);
    const auto network = make_network(*unlimited, config_.model, weights_);
    out.peak = unlimited->memory().peak();
  }
  return ran && out.peak <= ctx_.memory().limits().total;
}

Trainer::Plan Trainer::plan(long selected, std::optional<std::uint64_t> intersections) const {
  Plan out;
  const auto fits = [&](bool recompute, bool network_alone) {
    return plan_object(out, {rounded(selected), recompute}, selected, intersections, network_alone);
  };
  out.fits = fits(false, false) || fits(true, false);
  if (!out.fits) fits(true, true);
  return out;
}

Trainer::Plan Trainer::plan(std::optional<std::uint64_t> intersections) const { return plan(planned_, intersections); }

Trainer::Plan Trainer::bound() const {
  return plan(config_.model.selectable(), std::numeric_limits<std::uint64_t>::max());
}

}  // namespace vsplat

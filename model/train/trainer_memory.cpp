// The memory of a training: what is made for an object, what is done where that is not enough, and the plan of it.
#include <algorithm>
#include <cmath>
#include <limits>

#include "model/splat/room.h"
#include "model/train/trainer.h"
#include "runtime/fail.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

constexpr long kMargin = 1 << 16;  // elements for what drawing asks for beside the plans of its own

// More voxels are selected than there is room for.
struct MoreSelected {};

// What the attempts on an object allow, one after the other.
enum class Attempt { as_before, kept, recomputed };

// Whatever a plan came to, also where it ended early.
struct Noted {
  const Context& ctx;
  std::size_t& peak;
  std::vector<StageMemory>& stages;

  Noted(const Context& of, std::size_t& to_peak, std::vector<StageMemory>& to_stages)
      : ctx(of), peak(to_peak), stages(to_stages) {}
  ~Noted() {
    peak = ctx.memory().peak();
    stages = ctx.stage_memory();
  }
  Noted(const Noted&) = delete;
  Noted& operator=(const Noted&) = delete;
};

// A share with which a plan comes to exactly that many voxels.
double share_of(long selected, long voxels) {
  return (static_cast<double>(selected) + 0.5) / static_cast<double>(voxels);
}

}  // namespace

// Some more than were selected now, so that the next object fits, too.
long Trainer::rounded(long selected) const {
  const long voxels = config_.model.voxels(), unit = std::max(1L, voxels / 16);
  return std::min(voxels, (selected + unit - 1) / unit * unit);
}

void Trainer::make_room_for(Context& ctx, const VsplatModel& model, const Item& item, PassOptions options,
                            Room& room) const {
  const auto count = static_cast<long>(item.given.views->cameras.size());
  if (room.made_for >= count) return;
  options.forward.selection = nullptr;
  options.forward.assumed_selected = share_of(room.selected, config_.model.voxels());
  options.keep = {room.recompute, {}};
  options.assumed_intersections = {};
  const auto run = [&](Context& c) {
    const PassViews views = upload(c, item, options);
    training_pass(c, model, views, options);
  };
  if (!room.recompute) {  // what is kept must not be in the way of drawing
    options.whole = true;
    run(*ctx.planner());
  }
  options.network_alone = true;
  const auto with_margin = [&](Context& c) {
    const Tensor margin = c.tensor({kMargin}, Type::f32, "margin");
    run(c);
  };
  if (!make_room(ctx, with_margin)) {
    const auto planner = ctx.planner();
    run(*planner);
    fail(Status::memory,
         "not enough device memory: with {} of {} voxels selected and {} views a step needs {:.3f} GiB, {:.3f} GiB may "
         "be used (vsplat_device_options.max_memory_gib, fewer views, a smaller model or another device)",
         room.selected, config_.model.voxels(), count, gib(planner->memory().peak()), gib(ctx.memory().limits().total));
  }
  room.made_for = count;
}

DrawnPass Trainer::draw_in_room(Context& ctx, const VsplatModel& model, const Item& item, PassOptions options,
                                Room& room, long planned) const {
  long selected = config_.model.levels == "coarse" ? 0 : -1;  // not known yet
  Attempt attempt = Attempt::as_before;
  options.forward.assumed_selected = share_of(planned, config_.model.voxels());
  const auto begin_anew = [&] {
    room.made_for = 0;
    ctx.memory().trim();
  };
  if (room.made_for == 0) begin_anew();
  for (;;) {
    options.keep.recompute = room.recompute;
    options.keep.on_selected = [&](long count) {
      selected = count;
      if (count > room.selected) throw MoreSelected();
    };
    try {
      make_room_for(ctx, model, item, options, room);
      const PassViews views = upload(ctx, item, options);
      return draw_pass(ctx, model, views, options);
    } catch (const MoreSelected&) {
      room.selected = rounded(selected);
    } catch (const Error& e) {
      if (e.status() != Status::memory || attempt == Attempt::recomputed) throw;
      if (selected < 0 && room.selected > 0) {
        room.selected = 0;  // the coarse half tells
      } else {
        room.selected = rounded(std::max(selected, 0L));
        attempt = static_cast<Attempt>(static_cast<int>(attempt) + 1);
        room.recompute = attempt == Attempt::recomputed;
      }
    }
    begin_anew();
  }
}

void Trainer::run_planned(Plan& out, Room room, long selected, std::optional<std::uint64_t> intersections,
                          bool network_alone) const {
  const long s = config_.model.image, all = config_.inputs_max + config_.novel;
  TrainingViews views;
  views.inputs = static_cast<int>(config_.inputs_max);
  views.cameras.resize(static_cast<std::size_t>(all));
  for (Camera& camera : views.cameras) {
    camera.width = camera.height = static_cast<int>(s);
    camera.fx = camera.fy = static_cast<double>(s);
    camera.cx = camera.cy = static_cast<double>(s) / 2;
  }
  views.pictures.resize(static_cast<std::size_t>(all * s * s * 3));
  const auto first = ctx_.planner();
  const VsplatModel model(*first, config_.model, weights_);
  const auto second = first->planner();  // in which the model's slabs stand, as in a step
  Context& ctx = *second;
  const Noted noted{ctx, out.peak, out.stages};
  PassOptions options;
  options.assumed_intersections = intersections;
  const StepItem item{&views};
  if (network_alone) {
    options.network_alone = true;
    options.keep.recompute = room.recompute;
    options.forward.assumed_selected = share_of(selected, config_.model.voxels());
    const PassViews uploaded = upload(ctx, {item}, options);
    training_pass(ctx, model, uploaded, options);
  } else {
    finish_pass(ctx, model, draw_in_room(ctx, model, {item}, options, room, selected));
  }
  clip(ctx, ctx.tensor({2}, Type::f32, "gradient norm"));
}

Trainer::Plan Trainer::plan(long selected, std::optional<std::uint64_t> intersections) const {
  Plan out;
  const auto fits = [&](bool recompute, bool network_alone) {
    try {
      run_planned(out, {rounded(selected), recompute}, selected, intersections, network_alone);
      return out.peak <= ctx_.memory().limits().total;
    } catch (const Error& e) {
      if (e.status() != Status::memory) throw;
      out.problem = e.what();
      return false;
    }
  };
  out.fits = fits(false, false) || fits(true, false);
  if (!out.fits) fits(true, true);
  return out;
}

Trainer::Plan Trainer::plan(std::optional<std::uint64_t> intersections) const { return plan(assumed_, intersections); }

Trainer::Plan Trainer::bound() const { return plan(config_.model.voxels(), std::numeric_limits<std::uint64_t>::max()); }

}  // namespace vsplat

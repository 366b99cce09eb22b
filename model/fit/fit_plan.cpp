#include "model/fit/fit_plan.h"

#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

constexpr long kParts = 64;  // precision of affordable_gaussians(), as a share

}  // namespace

FitMemory plan_fit(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                   const Camera& camera) {
  const auto planner = ctx.planner();
  Fitter fitter(*planner, start, near, {}, options);
  if (options.antialias) fitter.set_cameras({camera});
  fitter.plan_grown();
  const long h = camera.height, w = camera.width;
  const DeviceFitPicture picture{camera, planner->tensor({h, w, 4}, Type::u8, "picture"),
                                 planner->tensor({h, w}, Type::u8, "known"), true};
  fitter.step(picture);
  fitter.measure(picture);
  return {planner->memory().peak(), planner->stage_memory()};
}

long affordable_gaussians(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                          const Camera& camera) {
  const auto fits = [&](long most) {
    FitOptions some = options;
    some.max_gaussians = most;
    try {
      return plan_fit(ctx, start, near, some, camera).peak <= ctx.memory().limits().total;
    } catch (const Error& e) {
      if (e.status() != Status::memory) throw;
      return false;
    }
  };
  if (fits(options.max_gaussians)) return options.max_gaussians;
  long low = static_cast<long>(start.count), high = options.max_gaussians;
  while (high - low > high / kParts) {
    const long middle = low + (high - low) / 2;
    (fits(middle) ? low : high) = middle;
  }
  return low;
}

std::size_t spare_room(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                       const Camera& camera) {
  const std::size_t limit = ctx.memory().limits().total, peak = plan_fit(ctx, start, near, options, camera).peak;
  if (peak > limit)
    fail(Status::memory,
         "not enough device memory: {} Gaussians fitted to pictures of {} x {} pixels take {:.4g} GiB, {:.4g} GiB may "
         "be used ({}; fewer {} or a smaller {} take less)",
         std::max(options.max_gaussians, static_cast<long>(start.count)), camera.width, camera.height, gib(peak),
         gib(limit), Option::max_memory, Option::max_gaussians, Option::longest);
  return limit - peak;
}

}  // namespace vsplat

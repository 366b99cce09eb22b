#include "model/fit/fit_plan.h"

#include <algorithm>

#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/system/host_memory.h"
#include "runtime/units.h"

namespace vsplat {
namespace {

constexpr long kParts = 64;          // precision of affordable_gaussians(), as a share
constexpr double kPairBytes = 64;    // of a Gaussian in a tile: its place in the order, and its gradient there
constexpr double kPlannedTiles = 8;  // RenderOptions::assumed_tiles
// Bytes of a picture's pixel: colour, alpha and whether it is known; while it is read in floats, too.
constexpr double kPictureBytes = 5, kReadBytes = 20;

// The host memory that a fit may use, with what its device has of it already.
double host_memory_of_fit(const Context& ctx) {
  const double own = ctx.memory().limits().on_host ? static_cast<double>(ctx.memory().reserved()) : 0;
  return static_cast<double>(host_memory_limit()) - static_cast<double>(reserved_host_memory()) + own;
}

}  // namespace

void plan_fit_in(Context& planner, const Gaussians& start, float near, const FitOptions& options,
                 const Camera& camera) {
  Fitter fitter(planner, start, near, {}, options);
  if (options.antialias) fitter.set_cameras({camera});
  fitter.plan_grown();
  const long h = camera.height, w = camera.width;
  DeviceFitPicture picture{camera, planner.tensor({h, w, 4}, Type::u8, "picture"),
                           planner.tensor({h, w}, Type::u8, "known"), true};
  if (options.depth_weight > 0) picture.depth = planner.tensor({h, w}, Type::f32, "depth");
  fitter.step(picture);
  fitter.measure(picture);
}

FitMemory plan_fit(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                   const Camera& camera, bool limited) {
  const auto planner = ctx.planner(limited);
  plan_fit_in(*planner, start, near, options, camera);
  return {planner->memory().peak(), planner->stage_memory()};
}

double fit_host_bytes(long gaussians, int degree, const Camera& camera) {
  const double each = 11.0 + 3.0 * (degree + 1) * (degree + 1);
  const double pixels = static_cast<double>(camera.width) * camera.height;
  return 3.0 * sizeof(float) * each * static_cast<double>(gaussians) + (2 * kPictureBytes + kReadBytes) * pixels;
}

long affordable_gaussians(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                          const Camera& camera) {
  const auto fits = [&](long most) {
    FitOptions some = options;
    some.max_gaussians = most;
    try {
      plan_fit(ctx, start, near, some, camera);  // no buffer is too large
      const std::size_t peak = plan_fit(ctx, start, near, some, camera, false).peak;
      const ArenaLimits& limits = ctx.memory().limits();
      const double all = static_cast<double>(peak) + fit_host_bytes(most, start.sh_degree, camera);
      return peak <= limits.total && (!limits.on_host || all <= host_memory_of_fit(ctx));
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

FitBudget fit_budget(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                     const Camera& camera) {
  FitBudget out;
  const ArenaLimits& limits = ctx.memory().limits();
  const long most = std::max(options.max_gaussians, static_cast<long>(start.count));
  try {
    out.fit = plan_fit(ctx, start, near, options, camera);
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    out.fit = plan_fit(ctx, start, near, options, camera, false);
    if (out.fit.peak <= limits.total) throw;
  }
  const std::size_t limit = limits.total, peak = out.fit.peak;
  if (peak > limit)
    fail(Status::memory,
         "not enough device memory: {} Gaussians fitted to pictures of {} x {} pixels take {:.4g} GiB, {:.4g} GiB may "
         "be used ({}; fewer {} or a smaller {} take less)",
         most, camera.width, camera.height, gib(peak), gib(limit), Option::max_memory, Option::max_gaussians,
         Option::longest);
  double on_device = static_cast<double>(limit - peak) / 2, for_pairs = on_device;
  out.host = fit_host_bytes(most, start.sh_degree, camera);
  double on_host = host_memory_of_fit(ctx) - out.host;
  if (limits.on_host) {
    on_host = std::max(on_host - static_cast<double>(peak), 0.0) / 3;
    on_device = std::min(on_device, on_host);
    for_pairs = std::min(for_pairs, on_host);
  }
  out.pairs = static_cast<std::uint64_t>(kPlannedTiles * static_cast<double>(most) + for_pairs / kPairBytes);
  out.on_device = static_cast<std::size_t>(on_device);
  out.on_host = static_cast<std::size_t>(std::clamp(on_host, 0.0, static_cast<double>(kMostCached)));
  return out;
}

}  // namespace vsplat

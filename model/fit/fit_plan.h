// The memory that a fit takes, found by planning a step and a measurement on a held-out view.
#pragma once
#include "model/fit/fitter.h"

namespace vsplat {

// The most bytes of decoded pictures that a fit caches in host memory.
inline constexpr std::size_t kMostCached = std::size_t{2} << 30;

struct FitMemory {
  std::size_t peak = 0;  // bytes, including what is allocated already
  std::vector<StageMemory> stages;
};

// Assumes that `start` grows to options.max_gaussians, and that each Gaussian touches eight tiles of a picture. Where
// that does not fit into memory, pictures are drawn in parts. Not `limited`: as if it always fitted.
FitMemory plan_fit(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                   const Camera& camera, bool limited = true);

// The same launches in a planner of the caller's.
void plan_fit_in(Context& planner, const Gaussians& start, float near, const FitOptions& options, const Camera& camera);

// The largest options.max_gaussians, up to the given one, for which there is memory without parts: on the device, and
// if that is the host's, for fit_host_bytes() beside it. The start's number if there is none.
long affordable_gaussians(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                          const Camera& camera);

// Bytes of host memory that a fit takes: the start, the best scene and the one being written, the picture in use and
// the one being read.
double fit_host_bytes(long gaussians, int degree, const Camera& camera);

struct FitBudget {
  FitMemory fit;
  double host = 0;  // fit_host_bytes()
  // Bytes for pictures beside the fit. They leave half of the device's free memory, or if the device uses the host's, a
  // third, for pictures in which Gaussians touch more tiles than planned.
  std::size_t on_device = 0, on_host = 0;
  std::uint64_t pairs = 0;  // FitOptions::most_pairs for which there is memory
};

// Error(memory) with both figures if the fit needs more device memory than may be used.
FitBudget fit_budget(const Context& ctx, const Gaussians& start, float near, const FitOptions& options,
                     const Camera& camera);

}  // namespace vsplat

// The measured peak performance of a device, to which profiles and benchmarks compare their rows.
#pragma once
#include <optional>

#include "runtime/context.h"
#include "runtime/profile/profile_sums.h"

namespace vsplat {

// Measures multiply-adds alone, and streaming through memory: more memory than the caches hold, if the device has it.
// Each runs for `seconds`, at least three launches, in a stream of its own.
double measure_gflops(Context& ctx, double seconds = 0.3);
double measure_gbs(Context& ctx, double seconds = 0.3);

// The peaks that were measured earlier on this device with this driver and these kernels, from the cache's folder
// (disk_cache.h).
std::optional<Peaks> known_peaks(const Context& ctx);
// The known peaks; if there are none, measures them now and stores them. It also measures again if a profile has seen
// more GFLOP/s: the device then was shared during the earlier measurement, and the greater value is stored. The
// measurement does not show in the context's profile.
Peaks peaks_of(Context& ctx, double gflops_seen = 0);
// The highest GFLOP/s of the rows that ran for at least a millisecond.
double gflops_seen(const Profile& profile);

}  // namespace vsplat

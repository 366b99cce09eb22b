// What a device can do at the most, measured: what the rows of a profile and of benchmarks are held against.
#pragma once
#include <optional>

#include "runtime/context.h"
#include "runtime/profile/profile_sums.h"

namespace vsplat {

// Multiply-adds alone; a stream through memory that is larger than caches, where there is room for it. Each for so many
// seconds, three launches at the least, in a stream of its own.
double measure_gflops(Context& ctx, double seconds = 0.3);
double measure_gbs(Context& ctx, double seconds = 0.3);

// Measured before on this device, with this driver and these kernels, and kept in the cache's folder (disk_cache.h).
std::optional<Peaks> known_peaks(const Context& ctx);
// The same; measured now and kept there where there are none, or where a profile has seen more GFLOP/s: then others
// used the device when they were measured, and the greater count. Nothing of it is in the context's profile.
Peaks peaks_of(Context& ctx, double gflops_seen = 0);
// The most GFLOP/s of a row that ran for a millisecond or more.
double gflops_seen(const Profile& profile);

}  // namespace vsplat

// A recorded profile, and the sums that follow from it alone.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "runtime/host_span.h"

namespace vsplat {

// The launches of one kernel with one range and one set of argument shapes.
struct ProfileVariant {
  std::array<std::size_t, 3> global{}, local{};  // zeros: the driver's choice, a transfer, or several variants together
  std::string shapes;                            // of the tensors: "[4, 64, 64, 3], [256]"
  std::uint64_t calls = 0, total_ns = 0;
  double flops = 0, bytes = 0;
};

struct ProfileRow {
  std::string name, stage;
  std::uint64_t calls = 0, total_ns = 0, min_ns = 0, max_ns = 0;
  double flops = 0, bytes = 0;
  const char* timed_by = "device";                // or "host"
  double performed_flops = 0;                     // less than `flops` if the method saves some, else equal
  std::uint64_t counted = 0;                      // what its kernels count: pairs of a pixel and a Gaussian
  std::uint64_t queued_ns = 0, submitted_ns = 0;  // time in the queue, and at the device, before they ran
  std::uint64_t first_calls = 0, first_ns = 0;    // of these: the first launches of a kernel with a work-group size
  std::uint64_t prepared_ns = 0;  // time of the driver before launches of a new variant; some drivers compile then
  std::vector<ProfileVariant> variants;
};

// One launch, on the host's clock; ns.
struct ProfileLaunch {
  std::size_t row = 0, variant = 0;
  bool first = false, prepared = false;
  std::uint64_t queued = 0, submitted = 0, start = 0, end = 0;
  std::uint64_t ready = 0;  // when it was submitted and all launches before it were done
};

struct ProfileWindow {
  std::uint64_t start, end;  // ns
};

struct Profile {
  std::vector<ProfileRow> rows;  // most time first
  std::vector<ProfileLaunch> launches;
  std::vector<HostRecord> host;
  std::vector<ProfileWindow> windows;  // when the profile was recording
  std::uint64_t without_times = 0;
};

// What an instant of wall time counts for: what the device runs then (upload: a transfer to it; device: anything else),
// else the first of these that is active. compile: by the library or, before first launches, by the driver; upload: the
// host's part; wait: the host waits for a device that runs nothing; other: nothing was recorded.
enum class WallPart : std::uint8_t { device, compile, upload, file, wait, host, other };
constexpr std::size_t kWallParts = 7;
const char* name_of(WallPart part);
using WallParts = std::array<std::uint64_t, kWallParts>;  // ns
std::uint64_t sum_of(const WallParts& parts);

// The wall time of a stage ("" outside of all stages); stages are in the order in which they began.
struct StageTotal {
  std::string stage;
  WallParts parts{};
  std::uint64_t launches_ns = 0;  // time of its launches
};

// The measured peak performance of a device.
struct Peaks {
  double gflops = 0, gbs = 0;
  double launch_us = 0;    // time of a launch that does nothing
  std::string measured;    // when: "2026-11-23"
  double measuring_s = 0;  // duration of the measurement, in addition to the run's wall time; 0: measured earlier
};

// What bounds a row. latency: at the peaks its work would take less time than an empty launch; otherwise operations or
// bytes, whichever would take longer. none: the number of neither is known.
enum class Bound : std::uint8_t { none, compute, memory, latency };
const char* name_of(Bound bound);
struct Roofline {
  Bound bound = Bound::none;
  double share_of_peak = 0;  // time that its work would take at the peaks, divided by the time that it took
};
Roofline roofline_of(const ProfileRow& row, const Peaks& peaks);

// The host's activity: spans of one kind and name.
struct HostRow {
  HostKind kind;
  std::string name;
  std::uint64_t calls = 0;
  std::uint64_t total_ns = 0;  // with nested spans
  std::uint64_t self_ns = 0;   // wall time that counts for no other row or part
};

struct WallSplit {
  WallParts parts{};               // add up to the wall time
  std::vector<StageTotal> stages;  // add up to the wall time, too
  std::vector<HostRow> host;       // most of its own time first
};

std::uint64_t wall_ns(const Profile& profile);
std::uint64_t launches_ns(const Profile& profile);
WallSplit split_wall(const Profile& profile);

// A sample of both clocks: the device's time of the queueing of a launch, and the host's times before and after the
// call that queued it.
struct QueuedAt {
  std::uint64_t device, before, after;  // ns
};
// The offset to subtract from the device's time to get the host's, within the limits of all samples if such an offset
// exists.
std::int64_t clock_offset(const std::vector<QueuedAt>& queued);

}  // namespace vsplat

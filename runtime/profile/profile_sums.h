// A profile as it was recorded, and what it adds up to: functions of it alone.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "runtime/host_span.h"

namespace vsplat {

// Launches of one kernel over one range, with arguments of one set of shapes.
struct ProfileVariant {
  std::array<std::size_t, 3> global{}, local{};  // zeros: the driver's choice, a transfer, or several put together
  std::string shapes;                            // of the tensors: "[4, 64, 64, 3], [256]"
  std::uint64_t calls = 0, total_ns = 0;
  double flops = 0, bytes = 0;
};

struct ProfileRow {
  std::string name, stage;
  std::uint64_t calls = 0, total_ns = 0, min_ns = 0, max_ns = 0;
  double flops = 0, bytes = 0;
  const char* timed_by = "device";                // or "host"
  double performed_flops = 0;                     // where a method saves some of `flops`; else the same
  std::uint64_t counted = 0;                      // what its kernels count: pairs of a pixel and a Gaussian
  std::uint64_t queued_ns = 0, submitted_ns = 0;  // in the queue, and at the device, before they ran
  std::uint64_t first_calls = 0, first_ns = 0;    // of these: first launches of a kernel with a work-group
  std::uint64_t prepared_ns = 0;  // that the driver took before launches of a new variant, which compile in some
  std::vector<ProfileVariant> variants;
};

// One launch, on the host's clock; ns.
struct ProfileLaunch {
  std::size_t row = 0, variant = 0;
  bool first = false, prepared = false;
  std::uint64_t queued = 0, submitted = 0, start = 0, end = 0;
  std::uint64_t ready = 0;  // when all before it was done and it was submitted
};

struct ProfileWindow {
  std::uint64_t start, end;  // ns
};

// What something took while the profile was recording.
struct Energy {
  std::string source;  // "package-0 (RAPL)"
  double joules = 0;
};

struct Profile {
  std::vector<ProfileRow> rows;  // most time first
  std::vector<ProfileLaunch> launches;
  std::vector<HostRecord> host;
  std::vector<ProfileWindow> windows;  // when it was recording
  std::uint64_t without_times = 0;
  std::vector<Energy> energy;  // empty where it cannot be read
};

// What an instant of the wall goes to: what the device runs then (upload: a transfer to it; device: all else), else the
// first of these that is at work. compile: by the library or, before first launches, by the driver; upload: the host's
// part; wait: the host waits for a device that has nothing running; other: nothing that was recorded.
enum class WallPart : std::uint8_t { device, compile, upload, file, wait, host, other };
constexpr std::size_t kWallParts = 7;
const char* name_of(WallPart part);
using WallParts = std::array<std::uint64_t, kWallParts>;  // ns
std::uint64_t sum_of(const WallParts& parts);

// Of the wall what went to a stage, "" being none; stages in the order in which they began.
struct StageTotal {
  std::string stage;
  WallParts parts{};
  std::uint64_t launches_ns = 0;  // of its launches' rows
};

// What a device can do at the most, measured.
struct Peaks {
  double gflops = 0, gbs = 0;
  double launch_us = 0;    // what a launch takes that does nothing
  std::string measured;    // when: "2026-11-23"
  double measuring_s = 0;  // that it took, beside the run's wall; 0: it was done before
};

// What bounds a row. latency: its work would take less at the peaks than a launch that does nothing; else whichever of
// operations and bytes takes longer there. none: of neither is known how many there are.
enum class Bound : std::uint8_t { none, compute, memory, latency };
const char* name_of(Bound bound);
struct Roofline {
  Bound bound = Bound::none;
  double share_of_peak = 0;  // what its work would take at the peaks, by what it took
};
Roofline roofline_of(const ProfileRow& row, const Peaks& peaks);

// What the host was at: spans of one kind and name.
struct HostRow {
  HostKind kind;
  std::string name;
  std::uint64_t calls = 0;
  std::uint64_t total_ns = 0;  // of all, with what lies in them
  std::uint64_t self_ns = 0;   // of the wall, what goes to no other
};

struct WallSplit {
  WallParts parts{};               // which add up to the wall
  std::vector<StageTotal> stages;  // and so do these
  std::vector<HostRow> host;       // most of its own time first
};

std::uint64_t wall_ns(const Profile& profile);
std::uint64_t launches_ns(const Profile& profile);
WallSplit split_wall(const Profile& profile);

// For the clocks: what the device did at its time lies between these two of the host's; that it queued a launch,
// between before and after the call.
struct QueuedAt {
  std::uint64_t device, before, after;  // ns
};
// What is to be taken from the device's time for the host's: within what all of them allow, where there is such a time.
std::int64_t clock_offset(const std::vector<QueuedAt>& queued);

}  // namespace vsplat

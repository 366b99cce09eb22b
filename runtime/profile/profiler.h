// Records where time goes: every launch on the device, and the host's work (host_span.h), on one clock. It is switched
// at run time. Events are collected in batches, so that measuring does not serialise the queue. A device without event
// times is timed on the host, one launch at a time, and marked so.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "runtime/launch.h"
#include "runtime/profile/profile_sums.h"

namespace cl {
class Event;
}

namespace vsplat {

// A launch to record.
struct LaunchRecord {
  const std::string& name;
  const std::string& stage;
  Cost cost;
  bool first = false;                   // the first one of that kernel with that work-group size
  std::uint64_t before = 0, after = 0;  // host times around the call that enqueued it
  // The variant of its kernel: a hash of `range` and `args`, which are read only if the hash is new. A null `range`:
  // unknown.
  std::uint64_t variant = 0;
  const Range* range = nullptr;
  KernelArgs args = {};
};

class Profiler {
 public:
  Profiler();
  ~Profiler();
  Profiler(const Profiler&) = delete;
  Profiler& operator=(const Profiler&) = delete;

  bool enabled() const { return enabled_; }
  // Wall time passes while the profiler is on; the first interval begins at HostLog::begin(), if that was called.
  void enable(bool on);

  void add_event(const LaunchRecord& launch, const cl::Event& event);
  void add_host(const LaunchRecord& launch, std::uint64_t start_ns, std::uint64_t end_ns);
  // Adds what the launches of a row have counted, and the operations that this took.
  void add_count(const std::string& stage, const std::string& name, std::uint64_t count, double flops);
  // Reads the times of finished events. Call it after the queue has drained.
  void collect();

  // The profile of all finished launches, with the wall time until now.
  Profile profile() const;
  std::vector<ProfileRow> rows() const;  // most time first
  double wall_seconds() const;
  void reset();

  // Counts compilations: of kernels, and launches in a new configuration, for which some drivers compile again. It
  // counts even while the profiler is off: if it rises during a measurement, the measured time includes compilation.
  void add_compilation() { ++compilations_; }
  long compilations() const { return compilations_; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  bool enabled_ = false;
  long compilations_ = 0;
};

}  // namespace vsplat

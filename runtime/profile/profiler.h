// Where the time goes: every launch on the device, and what the host does (host_span.h), on one clock. Switched at run
// time; events are gathered in batches so that measuring does not serialise the queue. A device without event times is
// timed on the host, one launch at a time, and marked so.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "runtime/launch.h"
#include "runtime/profile/energy.h"
#include "runtime/profile/profile_sums.h"

namespace cl {
class Event;
}

namespace vsplat {

// A launch as it is recorded.
struct LaunchRecord {
  const std::string& name;
  const std::string& stage;
  Cost cost;
  bool first = false;                   // of that kernel with that work-group
  std::uint64_t before = 0, after = 0;  // host's clock around the call that enqueued it
  // Which of its kernel's variants: the hash of both, which are read where the hash is new. null: not told.
  std::uint64_t variant = 0;
  const Range* range = nullptr;
  const std::vector<KernelArg>* args = nullptr;
};

class Profiler {
 public:
  Profiler();
  // What counts energy is asked for when it is switched on first.
  explicit Profiler(std::function<std::vector<EnergySource>()> energy);
  ~Profiler();
  Profiler(const Profiler&) = delete;
  Profiler& operator=(const Profiler&) = delete;

  bool enabled() const { return enabled_; }
  // The wall's time is what passes while it is on; the first time from HostLog::begin() on, where that was called.
  void enable(bool on);

  void add_event(const LaunchRecord& launch, const cl::Event& event);
  void add_host(const LaunchRecord& launch, std::uint64_t start_ns, std::uint64_t end_ns);
  // What its launches have counted, and the operations that this took.
  void add_count(const std::string& stage, const std::string& name, std::uint64_t count, double flops);
  // Reads the times of finished events. Call after the queue has been drained.
  void collect();

  // Of finished launches, and the wall until now.
  Profile profile() const;
  std::vector<ProfileRow> rows() const;  // most time first
  double wall_seconds() const;
  void reset();

  // How many kernels were compiled, or launched in a new way, for which some drivers compile once more. Counted whether
  // it is on or not: what was timed while this rose has a compiler's time in it.
  void add_compilation() { ++compilations_; }
  long compilations() const { return compilations_; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  bool enabled_ = false;
  long compilations_ = 0;
};

}  // namespace vsplat

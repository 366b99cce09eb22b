// Where the time goes, kernel by kernel. Switched at run time; events are gathered in batches so that measuring does
// not serialise the queue. A device without event times is timed on the host, one launch at a time, and marked so.
#pragma once
#include <cstdint>
#include <iosfwd>
#include <memory>
#include <string>
#include <vector>

namespace cl {
class Event;
}

namespace vsplat {

// What one launch costs: floating-point operations, and bytes that must move at the least.
struct Cost {
  double flops = 0;
  double bytes = 0;
};

struct ProfileRow {
  std::string name, stage;
  std::uint64_t calls = 0, total_ns = 0, min_ns = 0, max_ns = 0;
  double flops = 0, bytes = 0;
  const char* timed_by = "device";  // or "host"
};

class Profiler {
 public:
  Profiler();
  ~Profiler();
  Profiler(const Profiler&) = delete;
  Profiler& operator=(const Profiler&) = delete;

  bool enabled() const { return enabled_; }
  void enable(bool on) { enabled_ = on; }

  void add_event(const std::string& name, const std::string& stage, Cost cost, const cl::Event& event);
  void add_host(const std::string& name, const std::string& stage, Cost cost, std::uint64_t start_ns,
                std::uint64_t end_ns);
  // Reads the times of finished events. Call after the queue has been drained.
  void collect();

  // Wall time from the first enqueue to the last finish, summed over spans (see Context::finish).
  void begin_span();
  void end_span();
  // Time within a span that is not the device's: compilation.
  void exclude_from_span(double seconds);

  std::vector<ProfileRow> rows() const;  // most time first
  double wall_seconds() const;
  std::string table() const;
  std::string json(const std::string& device, const std::string& driver, std::uint64_t peak_bytes) const;
  std::string chrome_trace() const;
  void reset();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  bool enabled_ = false;
};

}  // namespace vsplat

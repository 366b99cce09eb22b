// Named intervals (spans) of the host's work, for profiles: on the host's clock (clock.h), from all threads of the
// process, recorded only while a profile is taken. In nested spans, time counts for the innermost one.
#pragma once
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace vsplat {

// host: computing; file: reading and writing; compile: building programs; upload: sending data to a device; wait:
// waiting for a device.
enum class HostKind : std::uint8_t { host, file, compile, upload, wait };
const char* name_of(HostKind kind);

struct HostRecord {
  std::uint64_t start = 0, end = 0;  // ns
  HostKind kind = HostKind::host;
  int thread = 0;                   // 0: the first thread that recorded
  std::string name, detail, stage;  // detail: tells spans of one name apart, for instance by a file's name; stage: see
                                    // Stage
};

// The log of this process. Thread-safe.
class HostLog {
 public:
  static HostLog& of_process();

  // The maximum number of spans. Beyond it the shortest ones are dropped, and their time counts for the spans that
  // enclose them.
  static constexpr std::size_t kMost = std::size_t{1} << 18;  // some 40 MB

  // Spans are recorded while there is at least one holder.
  void hold();
  void let_go();
  bool on() const { return holders_.load(std::memory_order_relaxed) > 0; }

  // Records from now on, until the next profile is switched on, which then begins at `at_ns`.
  void begin(std::uint64_t at_ns);
  // Returns the time that begin() set, and clears it; 0 if it is not set.
  std::uint64_t take_begin();

  void add(HostRecord record);
  // The spans that end after `from_ns`.
  std::vector<HostRecord> since(std::uint64_t from_ns) const;

 private:
  struct Impl;
  HostLog();
  Impl& impl_;
  std::atomic<int> holders_{0};
};

// During its life, the time of its thread counts for this kind and name.
class HostSpan {
 public:
  HostSpan(HostKind kind, std::string_view name, std::string_view detail = {});
  ~HostSpan();
  HostSpan(const HostSpan&) = delete;
  HostSpan& operator=(const HostSpan&) = delete;

 private:
  std::uint64_t start_ = 0;  // 0: not recorded
  HostKind kind_;
  std::string name_, detail_, stage_;
};

// Sets the stage of this thread's spans from now on. Returns the previous one.
std::string set_host_stage(const std::string& stage);

}  // namespace vsplat

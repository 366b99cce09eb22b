// What the host does, as stretches of its time with names, for profiles: on their clock (clock.h), of all threads of
// the process, recorded while a profile is taken and not otherwise. Where spans lie in one another, time is the inner
// one's.
#pragma once
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace vsplat {

// host: its own work; file: reading and writing; compile: programs; upload: data on their way to a device; wait: for a
// device.
enum class HostKind : std::uint8_t { host, file, compile, upload, wait };
const char* name_of(HostKind kind);

struct HostRecord {
  std::uint64_t start = 0, end = 0;  // ns
  HostKind kind = HostKind::host;
  int thread = 0;                   // 0: the first that was seen
  std::string name, detail, stage;  // detail: which of them, a file's name for instance; stage: see Stage
};

// The process's, and thread-safe.
class HostLog {
 public:
  static HostLog& of_process();

  // Of more than these the shortest are forgotten, and their time goes to what they lay in.
  static constexpr std::size_t kMost = std::size_t{1} << 18;  // some 40 MB

  // Spans are kept while at least one holds it.
  void hold();
  void let_go();
  bool on() const { return holders_.load(std::memory_order_relaxed) > 0; }

  // From now on it is held until the next profile is switched on, which then begins at that time.
  void begin(std::uint64_t at_ns);
  // That time, once; 0 where there is none.
  std::uint64_t take_begin();

  void add(HostRecord record);
  // Those that end after that time.
  std::vector<HostRecord> since(std::uint64_t from_ns) const;

 private:
  struct Impl;
  HostLog();
  Impl& impl_;
  std::atomic<int> holders_{0};
};

// While it lives, the time of its thread is of that kind and has that name.
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

// The stage that spans of this thread belong to from now on. -> the one before
std::string set_host_stage(const std::string& stage);

}  // namespace vsplat

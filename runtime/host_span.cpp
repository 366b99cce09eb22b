#include "runtime/host_span.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "runtime/clock.h"

namespace vsplat {
namespace {

// Shorter spans count for the span around them. Compiling and uploading are kept, since they are few.
constexpr std::uint64_t kShortest = 10'000;  // ns

thread_local std::string stage_of_thread;

int number_of_thread() {
  static std::atomic<int> next{0};
  thread_local const int mine = next++;
  return mine;
}

}  // namespace

const char* name_of(HostKind kind) {
  switch (kind) {
    case HostKind::host:
      return "host";
    case HostKind::file:
      return "file";
    case HostKind::compile:
      return "compile";
    case HostKind::upload:
      return "upload";
    case HostKind::wait:
      return "wait";
  }
  return "?";
}

struct HostLog::Impl {
  std::mutex mutex;
  std::vector<HostRecord> records;
  std::uint64_t begin = 0;
  std::uint64_t least = 0;  // ns; a span shorter than any dropped one is dropped, too

  void forget() {
    records = {};
    least = 0;
  }

  // Drops the shorter half of the spans.
  void forget_shortest() {
    std::vector<std::uint64_t> lengths;
    lengths.reserve(records.size());
    for (const HostRecord& record : records) lengths.push_back(record.end - record.start);
    const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
    std::nth_element(lengths.begin(), middle, lengths.end());
    least = *middle + 1;
    std::erase_if(records, [&](const HostRecord& record) { return record.end - record.start < least; });
  }
};

// Never destroyed: threads may outlive static objects.
HostLog::HostLog() : impl_(*new Impl) {}

HostLog& HostLog::of_process() {
  static auto& log = *new HostLog;
  return log;
}

void HostLog::hold() { ++holders_; }

void HostLog::let_go() {
  const std::lock_guard lock(impl_.mutex);
  if (--holders_ == 0) impl_.forget();
}

void HostLog::begin(std::uint64_t at_ns) {
  const std::lock_guard lock(impl_.mutex);
  if (impl_.begin == 0) ++holders_;
  impl_.begin = at_ns;
}

std::uint64_t HostLog::take_begin() {
  const std::lock_guard lock(impl_.mutex);
  const std::uint64_t at = std::exchange(impl_.begin, 0);
  if (at != 0 && --holders_ == 0) impl_.forget();
  return at;
}

void HostLog::add(HostRecord record) {
  record.thread = number_of_thread();
  const std::lock_guard lock(impl_.mutex);
  if (holders_ == 0 || record.end - record.start < impl_.least) return;
  if (impl_.records.size() == kMost) impl_.forget_shortest();
  impl_.records.push_back(std::move(record));
}

std::vector<HostRecord> HostLog::since(std::uint64_t from_ns) const {
  const std::lock_guard lock(impl_.mutex);
  std::vector<HostRecord> out;
  for (const HostRecord& record : impl_.records)
    if (record.end > from_ns) out.push_back(record);
  return out;
}

HostSpan::HostSpan(HostKind kind, std::string_view name, std::string_view detail) : kind_(kind) {
  if (!HostLog::of_process().on()) return;
  name_ = name;
  detail_ = detail;
  stage_ = stage_of_thread;
  start_ = now_ns();
}

HostSpan::~HostSpan() {
  if (start_ == 0) return;
  const std::uint64_t end = now_ns();
  if (kind_ != HostKind::compile && kind_ != HostKind::upload && end - start_ < kShortest) return;
  try {
    HostLog::of_process().add({start_, end, kind_, 0, std::move(name_), std::move(detail_), std::move(stage_)});
  } catch (const std::exception&) {  // without memory for it, it is not recorded
  }
}

std::string set_host_stage(const std::string& stage) { return std::exchange(stage_of_thread, stage); }

}  // namespace vsplat

#include "runtime/profile/profiler.h"

#include <algorithm>
#include <map>
#include <utility>

#include "runtime/clock.h"
#include "runtime/launch_arguments.h"
#include "runtime/opencl.h"

namespace vsplat {

namespace {

// If a driver takes at least this long before a launch of a new size, that time is compilation; before a kernel's first
// launch it always is.
constexpr std::uint64_t kCompiles = 5'000'000;  // ns
constexpr std::size_t kVariants = 32;           // for a row; the last variant takes all further ones

struct Pending {
  std::size_t row, variant;
  bool first, prepared;
  std::uint64_t before, after;
  cl::Event event;
};

// Times that the driver reports; all 0 if it reports none, or impossible ones.
struct EventTimes {
  std::uint64_t queued = 0, submitted = 0, start = 0, end = 0;
};

EventTimes times_of(const cl::Event& event) {
  try {
    EventTimes out{
        event.getProfilingInfo<CL_PROFILING_COMMAND_QUEUED>(), event.getProfilingInfo<CL_PROFILING_COMMAND_SUBMIT>(),
        event.getProfilingInfo<CL_PROFILING_COMMAND_START>(), event.getProfilingInfo<CL_PROFILING_COMMAND_END>()};
    if (out.end < out.start || out.end == 0) return {};
    // Phases that a driver does not report are assumed to be short.
    if (out.submitted == 0 || out.submitted > out.start) out.submitted = out.start;
    if (out.queued == 0 || out.queued > out.submitted) out.queued = out.submitted;
    return out;
  } catch (const cl::Error&) {
    return {};
  }
}

}  // namespace

struct Profiler::Impl {
  std::vector<ProfileRow> rows;
  std::map<std::pair<std::string, std::string>, std::size_t> index;
  std::vector<std::map<std::uint64_t, std::size_t>> variant_index;  // for each row
  std::vector<Pending> pending;
  std::vector<ProfileLaunch> launches;
  std::vector<ProfileWindow> windows;
  std::vector<HostRecord> host;  // for windows that have ended
  std::uint64_t last_end = 0, suspicious = 0;

  std::size_t row(const LaunchRecord& launch, const char* timed_by) {
    const auto [it, fresh] = index.emplace(std::make_pair(launch.stage, launch.name), rows.size());
    if (fresh) {
      rows.emplace_back();
      rows.back().name = launch.name;
      rows.back().stage = launch.stage;
      rows.back().timed_by = timed_by;
      variant_index.emplace_back();
    }
    return it->second;
  }

  // Returns the variant's index in the row, and whether it is new there.
  std::pair<std::size_t, bool> variant(std::size_t row, const LaunchRecord& launch) {
    ProfileRow& r = rows[row];
    const auto [it, fresh] = variant_index[row].emplace(launch.variant, std::min(r.variants.size(), kVariants - 1));
    if (fresh && r.variants.size() < kVariants) {
      r.variants.push_back(launch.range ? variant_of(*launch.range, launch.args) : ProfileVariant());
    } else if (fresh) {
      r.variants.back().global = r.variants.back().local = {};
      r.variants.back().shapes = "others";
    }
    return {it->second, fresh};
  }

  void count(const ProfileLaunch& launch) {
    ProfileRow& r = rows[launch.row];
    const std::uint64_t ns = launch.end - launch.start;
    r.min_ns = r.calls ? std::min(r.min_ns, ns) : ns;
    r.max_ns = std::max(r.max_ns, ns);
    r.total_ns += ns;
    ++r.calls;
    r.queued_ns += launch.submitted - launch.queued;
    r.submitted_ns += launch.start - launch.submitted;
    if (launch.first) {
      ++r.first_calls;
      r.first_ns += ns;
    }
    if (launch.prepared) r.prepared_ns += launch.start - std::min(launch.ready, launch.start);
    ProfileVariant& v = r.variants[launch.variant];
    ++v.calls;
    v.total_ns += ns;
    launches.push_back(launch);
  }

  void spend(std::size_t row, std::size_t variant, Cost cost) {
    ProfileRow& r = rows[row];
    r.flops += cost.flops;
    r.bytes += cost.bytes;
    r.performed_flops += cost.performed > 0 ? cost.performed : cost.flops;
    r.variants[variant].flops += cost.flops;
    r.variants[variant].bytes += cost.bytes;
  }
};

Profiler::Profiler() : impl_(std::make_unique<Impl>()) {}
Profiler::~Profiler() {
  if (enabled_) HostLog::of_process().let_go();
}

void Profiler::enable(bool on) {
  if (on == enabled_) return;
  enabled_ = on;
  HostLog& log = HostLog::of_process();
  if (on) {
    log.hold();
    const std::uint64_t begun = log.take_begin(), now = now_ns();
    impl_->windows.push_back({impl_->windows.empty() && begun != 0 ? std::min(begun, now) : now, 0});
  } else {
    impl_->windows.back().end = now_ns();
    for (HostRecord& record : log.since(impl_->windows.back().start)) impl_->host.push_back(std::move(record));
    log.let_go();
  }
}

void Profiler::add_event(const LaunchRecord& launch, const cl::Event& event) {
  const std::size_t row = impl_->row(launch, "device");
  const auto [variant, fresh] = impl_->variant(row, launch);
  impl_->spend(row, variant, launch.cost);
  impl_->pending.push_back({row, variant, launch.first, fresh, launch.before, launch.after, event});
}

void Profiler::add_host(const LaunchRecord& launch, std::uint64_t start_ns, std::uint64_t end_ns) {
  const std::size_t row = impl_->row(launch, "host");
  const auto [variant, fresh] = impl_->variant(row, launch);
  impl_->spend(row, variant, launch.cost);
  impl_->count({row, variant, launch.first, false, start_ns, start_ns, start_ns, end_ns, start_ns});
}

void Profiler::add_count(const std::string& stage, const std::string& name, std::uint64_t count, double flops) {
  const auto found = impl_->index.find({stage, name});
  if (found == impl_->index.end()) return;
  ProfileRow& row = impl_->rows[found->second];
  row.counted += count;
  row.flops += flops;
  row.performed_flops += flops;
}

void Profiler::collect() {
  std::vector<EventTimes> times;
  std::vector<QueuedAt> queued;
  const std::uint64_t now = now_ns();
  times.reserve(impl_->pending.size());
  for (const Pending& p : impl_->pending) {
    times.push_back(times_of(p.event));
    if (times.back().end == 0) continue;
    queued.push_back({times.back().queued, p.before, p.after});
    queued.push_back({times.back().end, p.before, now});  // the launch is finished
  }
  const std::int64_t offset = clock_offset(queued);
  const auto on_host = [&](std::uint64_t device) { return device - static_cast<std::uint64_t>(offset); };
  for (std::size_t i = 0; i < times.size(); ++i) {
    const Pending& p = impl_->pending[i];
    ProfileLaunch launch{p.row, p.variant, p.first, p.prepared, p.after, p.after, p.after, p.after, p.after};
    if (times[i].end == 0) {
      ++impl_->suspicious;
    } else {
      launch.queued = on_host(times[i].queued), launch.submitted = on_host(times[i].submitted);
      launch.start = on_host(times[i].start), launch.end = on_host(times[i].end);
      launch.ready = std::max(launch.submitted, impl_->last_end);
      impl_->last_end = std::max(impl_->last_end, launch.end);
      launch.prepared = launch.prepared && (launch.first || launch.ready + kCompiles <= launch.start);
    }
    impl_->count(launch);
  }
  impl_->pending.clear();
}

std::vector<ProfileRow> Profiler::rows() const {
  std::vector<ProfileRow> out = impl_->rows;
  std::stable_sort(out.begin(), out.end(),
                   [](const ProfileRow& a, const ProfileRow& b) { return a.total_ns > b.total_ns; });
  return out;
}

Profile Profiler::profile() const {
  Profile out;
  out.windows = impl_->windows;
  if (enabled_) out.windows.back().end = now_ns();
  std::vector<std::size_t> order(impl_->rows.size()), place(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return impl_->rows[a].total_ns > impl_->rows[b].total_ns; });
  for (std::size_t i = 0; i < order.size(); ++i) {
    out.rows.push_back(impl_->rows[order[i]]);
    place[order[i]] = i;
  }
  out.launches = impl_->launches;
  for (ProfileLaunch& launch : out.launches) launch.row = place[launch.row];
  out.host = impl_->host;
  if (enabled_)
    for (HostRecord& record : HostLog::of_process().since(out.windows.back().start))
      out.host.push_back(std::move(record));
  out.without_times = impl_->suspicious;
  return out;
}

double Profiler::wall_seconds() const {
  std::uint64_t ns = 0;
  for (const ProfileWindow& window : impl_->windows) ns += (window.end != 0 ? window.end : now_ns()) - window.start;
  return static_cast<double>(ns) * 1e-9;
}

void Profiler::reset() {
  *impl_ = Impl();
  if (!enabled_) return;
  enabled_ = false;
  enable(true);
  HostLog::of_process().let_go();  // it is held twice now
}

}  // namespace vsplat

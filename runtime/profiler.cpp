#include "runtime/profiler.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "runtime/clock.h"
#include "runtime/opencl.h"

namespace vsplat {

namespace {

struct Launch {
  std::size_t row;
  std::uint64_t start, end;  // ns, the device's clock or the host's
};

}  // namespace

struct Profiler::Impl {
  std::vector<ProfileRow> rows;
  std::map<std::pair<std::string, std::string>, std::size_t> index;
  std::vector<std::pair<std::size_t, cl::Event>> pending;
  std::vector<Launch> launches;
  bool in_span = false;
  std::uint64_t span_start = 0, wall_ns = 0, suspicious = 0;

  std::size_t row(const std::string& name, const std::string& stage, Cost cost, const char* timed_by) {
    const auto [it, fresh] = index.emplace(std::make_pair(stage, name), rows.size());
    if (fresh) {
      rows.push_back({});
      rows.back().name = name;
      rows.back().stage = stage;
      rows.back().timed_by = timed_by;
    }
    ProfileRow& r = rows[it->second];
    r.flops += cost.flops;
    r.bytes += cost.bytes;
    return it->second;
  }

  void count(std::size_t at, std::uint64_t start, std::uint64_t end) {
    ProfileRow& r = rows[at];
    const std::uint64_t ns = end - start;
    r.min_ns = r.calls ? std::min(r.min_ns, ns) : ns;
    r.max_ns = std::max(r.max_ns, ns);
    r.total_ns += ns;
    ++r.calls;
    launches.push_back({at, start, end});
  }
};

Profiler::Profiler() : impl_(std::make_unique<Impl>()) {}
Profiler::~Profiler() = default;

void Profiler::add_event(const std::string& name, const std::string& stage, Cost cost, const cl::Event& event) {
  impl_->pending.emplace_back(impl_->row(name, stage, cost, "device"), event);
}

void Profiler::add_host(const std::string& name, const std::string& stage, Cost cost, std::uint64_t start_ns,
                        std::uint64_t end_ns) {
  impl_->count(impl_->row(name, stage, cost, "host"), start_ns, end_ns);
}

void Profiler::collect() {
  for (auto& [row, event] : impl_->pending) {
    std::uint64_t start = 0, end = 0;
    try {
      start = event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
      end = event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
    } catch (const cl::Error&) {  // counted below with the other times that cannot be
    }
    if (end < start || end == 0) {
      ++impl_->suspicious;
      end = start;
    }
    impl_->count(row, start, end);
  }
  impl_->pending.clear();
}

void Profiler::begin_span() {
  if (impl_->in_span) return;
  impl_->in_span = true;
  impl_->span_start = now_ns();
}

void Profiler::exclude_from_span(double seconds) {
  if (impl_->in_span) impl_->span_start += static_cast<std::uint64_t>(seconds * 1e9);
}

void Profiler::end_span() {
  if (!impl_->in_span) return;
  impl_->in_span = false;
  const std::uint64_t now = now_ns();
  if (now > impl_->span_start) impl_->wall_ns += now - impl_->span_start;
}

std::vector<ProfileRow> Profiler::rows() const {
  std::vector<ProfileRow> out = impl_->rows;
  std::stable_sort(out.begin(), out.end(),
                   [](const ProfileRow& a, const ProfileRow& b) { return a.total_ns > b.total_ns; });
  return out;
}

double Profiler::wall_seconds() const { return static_cast<double>(impl_->wall_ns) * 1e-9; }

std::string Profiler::table() const {
  const std::vector<ProfileRow> all = rows();
  double total = 0;
  for (const ProfileRow& r : all) total += static_cast<double>(r.total_ns);
  std::string out =
      fmt::format("{:<28} {:<11} {:>7} {:>12} {:>7} {:>11} {:>11} {:>11} {:>9} {:>8}\n", "Kernel", "Stage", "Calls",
                  "Time (us)", "Time %", "Avg (us)", "Min (us)", "Max (us)", "GFLOP/s", "GB/s");
  for (const ProfileRow& r : all) {
    const double ns = static_cast<double>(r.total_ns);
    out += fmt::format("{:<28} {:<11} {:>7} {:>12.1f} {:>6.1f}% {:>11.1f} {:>11.1f} {:>11.1f} {:>9.1f} {:>8.1f}{}\n",
                       r.name, r.stage, r.calls, ns * 1e-3, total > 0 ? 100 * ns / total : 0.0,
                       r.calls ? ns * 1e-3 / static_cast<double>(r.calls) : 0.0, static_cast<double>(r.min_ns) * 1e-3,
                       static_cast<double>(r.max_ns) * 1e-3, ns > 0 ? r.flops / ns : 0.0, ns > 0 ? r.bytes / ns : 0.0,
                       std::string(r.timed_by) == "host" ? "  (host timing)" : "");
  }
  out += fmt::format("kernels {:.3f} s, wall {:.3f} s, not in kernels {:.3f} s\n", total * 1e-9, wall_seconds(),
                     wall_seconds() - total * 1e-9);
  if (impl_->suspicious)
    out += fmt::format("{} launches came without usable times from the driver and count as 0\n", impl_->suspicious);
  return out;
}

std::string Profiler::json(const std::string& device, const std::string& driver, std::uint64_t peak_bytes) const {
  nlohmann::ordered_json out;
  out["device"] = device;
  out["driver"] = driver;
  out["wall_s"] = wall_seconds();
  out["peak_bytes"] = peak_bytes;
  double total = 0;
  out["kernels"] = nlohmann::ordered_json::array();
  for (const ProfileRow& r : rows()) {
    total += static_cast<double>(r.total_ns);
    out["kernels"].push_back({{"name", r.name},
                              {"stage", r.stage},
                              {"calls", r.calls},
                              {"total_ns", r.total_ns},
                              {"min_ns", r.min_ns},
                              {"max_ns", r.max_ns},
                              {"flops", r.flops},
                              {"bytes", r.bytes},
                              {"timed_by", r.timed_by}});
  }
  out["kernels_s"] = total * 1e-9;
  out["launches_without_times"] = impl_->suspicious;
  return out.dump(1) + "\n";
}

std::string Profiler::chrome_trace() const {
  nlohmann::ordered_json events = nlohmann::ordered_json::array();
  std::uint64_t first = UINT64_MAX;
  for (const Launch& l : impl_->launches) first = std::min(first, l.start);
  for (const Launch& l : impl_->launches) {
    const ProfileRow& r = impl_->rows[l.row];
    events.push_back({{"name", r.name},
                      {"cat", r.stage},
                      {"ph", "X"},
                      {"pid", 1},
                      {"tid", r.timed_by},
                      {"ts", static_cast<double>(l.start - first) * 1e-3},
                      {"dur", static_cast<double>(l.end - l.start) * 1e-3}});
  }
  return nlohmann::ordered_json{{"traceEvents", events}, {"displayTimeUnit", "ms"}}.dump() + "\n";
}

void Profiler::reset() { *impl_ = Impl{}; }

}  // namespace vsplat

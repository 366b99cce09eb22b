#include "runtime/profile/profile_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace vsplat {
namespace {

using Json = nlohmann::ordered_json;

double seconds(std::uint64_t ns) { return static_cast<double>(ns) * 1e-9; }

Json parts_json(const WallParts& parts) {
  Json out = Json::object();
  for (std::size_t p = 0; p < kWallParts; ++p)
    out[std::string(name_of(static_cast<WallPart>(p))) + "_s"] = seconds(parts[p]);
  return out;
}

Json variant_json(const ProfileVariant& v) {
  return {{"global", v.global},     {"local", v.local}, {"shapes", v.shapes}, {"calls", v.calls},
          {"total_ns", v.total_ns}, {"flops", v.flops}, {"bytes", v.bytes}};
}

Json row_json(const ProfileRow& r, const std::optional<Peaks>& peaks) {
  Json out = {{"name", r.name},
              {"stage", r.stage},
              {"calls", r.calls},
              {"total_ns", r.total_ns},
              {"min_ns", r.min_ns},
              {"max_ns", r.max_ns},
              {"flops", r.flops},
              {"bytes", r.bytes},
              {"timed_by", r.timed_by},
              {"performed_flops", r.performed_flops},
              {"counted", r.counted},
              {"queued_ns", r.queued_ns},
              {"submitted_ns", r.submitted_ns},
              {"first_calls", r.first_calls},
              {"first_ns", r.first_ns},
              {"prepared_ns", r.prepared_ns},
              {"launches", Json::array()}};
  if (peaks) {
    const Roofline roof = roofline_of(r, *peaks);
    out["bound"] = name_of(roof.bound);
    out["share_of_peak"] = roof.share_of_peak;
  }
  for (const ProfileVariant& v : r.variants) out["launches"].push_back(variant_json(v));
  return out;
}

std::string dumped(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string roof_text(const Roofline& roof) {
  return roof.bound == Bound::none ? "" : fmt::format(" {:>8.1f}%  {}", 100 * roof.share_of_peak, name_of(roof.bound));
}

std::string kernel_lines(const Profile& profile, const std::optional<Peaks>& peaks) {
  const double total = static_cast<double>(launches_ns(profile));
  std::string out = fmt::format("{:<28} {:<11} {:>7} {:>12} {:>7} {:>11} {:>11} {:>11} {:>9} {:>8}{}\n", "Kernel",
                                "Stage", "Calls", "Time (us)", "Time %", "Avg (us)", "Min (us)", "Max (us)", "GFLOP/s",
                                "GB/s", peaks ? "  of peak  bound" : "");
  for (const ProfileRow& r : profile.rows) {
    const double ns = static_cast<double>(r.total_ns);
    out += fmt::format("{:<28} {:<11} {:>7} {:>12.1f} {:>6.1f}% {:>11.1f} {:>11.1f} {:>11.1f} {:>9.1f} {:>8.1f}{}\n",
                       r.name, r.stage, r.calls, ns * 1e-3, total > 0 ? 100 * ns / total : 0.0,
                       r.calls ? ns * 1e-3 / static_cast<double>(r.calls) : 0.0, static_cast<double>(r.min_ns) * 1e-3,
                       static_cast<double>(r.max_ns) * 1e-3, ns > 0 ? r.flops / ns : 0.0, ns > 0 ? r.bytes / ns : 0.0,
                       (peaks ? roof_text(roofline_of(r, *peaks)) : "") +
                           (std::string(r.timed_by) == "host" ? "  (host timing)" : ""));
  }
  return out;
}

std::string host_lines(const WallSplit& split) {
  std::string out =
      fmt::format("\n{:<40} {:<8} {:>7} {:>10} {:>10}\n", "Host", "Kind", "Times", "Total (s)", "Own (s)");
  for (const HostRow& row : split.host) {
    if (row.self_ns < 1'000'000 && row.total_ns < 1'000'000) continue;
    out += fmt::format("{:<40} {:<8} {:>7} {:>10.3f} {:>10.3f}\n", row.name, name_of(row.kind), row.calls,
                       seconds(row.total_ns), seconds(row.self_ns));
  }
  return out;
}

std::string stage_lines(const WallSplit& split) {
  std::string out = fmt::format("\n{:<16}", "Stage (s)");
  for (std::size_t p = 0; p < kWallParts; ++p) out += fmt::format(" {:>8}", name_of(static_cast<WallPart>(p)));
  out += fmt::format(" {:>8}\n", "sum");
  const auto line = [&](const std::string& name, const WallParts& parts) {
    out += fmt::format("{:<16}", name);
    for (const std::uint64_t ns : parts) out += fmt::format(" {:>8.3f}", seconds(ns));
    out += fmt::format(" {:>8.3f}\n", seconds(sum_of(parts)));
  };
  for (const StageTotal& total : split.stages) line(total.stage.empty() ? "-" : total.stage, total.parts);
  line("wall", split.parts);
  return out;
}

// Names the lanes of a timeline, and assigns spans to them.
class Lanes {
 public:
  explicit Lanes(std::uint64_t first) : first_(first) {
    put({{"name", "process_name"}, {"ph", "M"}, {"pid", 1}, {"args", {{"name", "vsplat"}}}});
  }

  void name(int lane, const std::string& name) {
    put({{"name", "thread_name"}, {"ph", "M"}, {"pid", 1}, {"tid", lane}, {"args", {{"name", name}}}});
    put({{"name", "thread_sort_index"}, {"ph", "M"}, {"pid", 1}, {"tid", lane}, {"args", {{"sort_index", lane}}}});
  }
  void span(int lane, const std::string& name, const std::string& category, std::uint64_t start, std::uint64_t end,
            Json args = Json::object()) {
    Json event = {{"name", name},
                  {"cat", category},
                  {"ph", "X"},
                  {"pid", 1},
                  {"tid", lane},
                  {"ts", microseconds(start)},
                  {"dur", static_cast<double>(end - start) * 1e-3}};
    if (!args.empty()) event["args"] = std::move(args);
    put(std::move(event));
  }
  void counter(const std::string& name, std::uint64_t at, Json values) {
    put({{"name", name}, {"ph", "C"}, {"pid", 1}, {"ts", microseconds(at)}, {"args", std::move(values)}});
  }
  std::string text() const { return dumped(Json{{"traceEvents", events_}, {"displayTimeUnit", "ms"}}, -1); }

 private:
  double microseconds(std::uint64_t at) const { return at < first_ ? 0.0 : static_cast<double>(at - first_) * 1e-3; }
  void put(Json event) { events_.push_back(std::move(event)); }

  std::uint64_t first_;
  Json events_ = Json::array();
};

constexpr int kDeviceLane = 1, kPrepareLane = 2, kHostLane = 10, kLanesOfThread = 10;

// Adds the number of waiting launches: those that are enqueued but not submitted, and those submitted but not running.
void put_waiting(const Profile& profile, Lanes& lanes) {
  std::vector<std::pair<std::uint64_t, std::pair<int, int>>> changes;
  for (const ProfileLaunch& l : profile.launches) {
    changes.push_back({l.queued, {1, 0}});
    changes.push_back({l.submitted, {-1, 1}});
    changes.push_back({l.start, {0, -1}});
  }
  std::stable_sort(changes.begin(), changes.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  int queued = 0, submitted = 0;
  for (std::size_t i = 0; i < changes.size(); ++i) {
    queued += changes[i].second.first;
    submitted += changes[i].second.second;
    if (i + 1 < changes.size() && changes[i + 1].first == changes[i].first) continue;
    lanes.counter("launches that wait", changes[i].first, {{"queued", queued}, {"submitted", submitted}});
  }
}

}  // namespace

std::string profile_table(const Profile& profile, const std::optional<Peaks>& peaks) {
  const WallSplit split = split_wall(profile);
  const double total = seconds(launches_ns(profile)), wall = seconds(wall_ns(profile));
  std::string out = kernel_lines(profile, peaks) + host_lines(split) + stage_lines(split);
  out += fmt::format("kernels {:.3f} s, wall {:.3f} s, not in kernels {:.3f} s\n", total, wall, wall - total);
  if (profile.without_times)
    out += fmt::format("{} launches have no usable times from the driver and count as 0\n", profile.without_times);
  return out;
}

std::string profile_json(const Profile& profile, const ProfileSubject& subject) {
  const WallSplit split = split_wall(profile);
  Json out;
  out["device"] = subject.device;
  out["driver"] = subject.driver;
  out["tuning"] = subject.tuning.empty() ? Json() : Json(subject.tuning);
  out["precision"] = name_of(subject.precision);
  out["run"] = Json::object();
  for (const auto& [what, name] : subject.names) out["run"][what] = name;
  if (subject.peaks)
    out["peaks"] = {{"gflops", subject.peaks->gflops},
                    {"gbs", subject.peaks->gbs},
                    {"launch_us", subject.peaks->launch_us},
                    {"measured", subject.peaks->measured},
                    {"measuring_s", subject.peaks->measuring_s}};
  out["wall_s"] = seconds(wall_ns(profile));
  out["wall"] = parts_json(split.parts);
  out["peak_bytes"] = subject.peak_bytes;
  if (!profile.energy.empty()) {
    out["energy"] = Json::array();
    for (const Energy& energy : profile.energy)
      out["energy"].push_back({{"source", energy.source}, {"joules", energy.joules}});
  }
  out["kernels"] = Json::array();
  for (const ProfileRow& r : profile.rows) out["kernels"].push_back(row_json(r, subject.peaks));
  out["kernels_s"] = seconds(launches_ns(profile));
  out["launches_without_times"] = profile.without_times;
  out["stages"] = Json::array();
  for (const StageTotal& total : split.stages) {
    Json stage = {
        {"stage", total.stage}, {"wall_s", seconds(sum_of(total.parts))}, {"kernels_s", seconds(total.launches_ns)}};
    stage.update(parts_json(total.parts));
    out["stages"].push_back(std::move(stage));
  }
  out["host"] = Json::array();
  for (const HostRow& row : split.host)
    out["host"].push_back({{"kind", name_of(row.kind)},
                           {"name", row.name},
                           {"calls", row.calls},
                           {"total_s", seconds(row.total_ns)},
                           {"self_s", seconds(row.self_ns)}});
  return dumped(out, 1);
}

std::string profile_trace(const Profile& profile) {
  std::uint64_t first = profile.windows.empty() ? UINT64_MAX : profile.windows.front().start;
  for (const ProfileLaunch& l : profile.launches) first = std::min(first, l.queued);
  Lanes lanes(first);
  lanes.name(kDeviceLane, "device: running");
  lanes.name(kPrepareLane, "device: preparing first launches");
  int threads = 0;
  for (const HostRecord& record : profile.host) threads = std::max(threads, record.thread + 1);
  for (int thread = 0; thread < threads; ++thread) {
    const std::string of = thread == 0 ? "" : fmt::format(" of thread {}", thread + 1);
    for (const HostKind kind : {HostKind::host, HostKind::file, HostKind::compile, HostKind::upload, HostKind::wait})
      if (std::any_of(profile.host.begin(), profile.host.end(),
                      [&](const HostRecord& r) { return r.thread == thread && r.kind == kind; }))
        lanes.name(kHostLane + kLanesOfThread * thread + static_cast<int>(kind), name_of(kind) + of);
  }
  for (const ProfileLaunch& l : profile.launches) {
    const ProfileRow& r = profile.rows[l.row];
    Json args = {{"queued_us", static_cast<double>(l.submitted - l.queued) * 1e-3},
                 {"submitted_us", static_cast<double>(l.start - l.submitted) * 1e-3},
                 {"timed_by", r.timed_by}};
    if (l.first) args["first"] = true;
    lanes.span(kDeviceLane, r.name, r.stage, l.start, l.end, std::move(args));
    if (l.prepared && l.ready < l.start) lanes.span(kPrepareLane, r.name, "compile", l.ready, l.start);
  }
  for (const HostRecord& record : profile.host) {
    Json args = Json::object();
    if (!record.detail.empty()) args["of"] = record.detail;
    if (!record.stage.empty()) args["stage"] = record.stage;
    const std::uint64_t start = std::max(record.start, first);
    lanes.span(kHostLane + kLanesOfThread * record.thread + static_cast<int>(record.kind), record.name,
               name_of(record.kind), start, std::max(record.end, start), std::move(args));
  }
  put_waiting(profile, lanes);
  return lanes.text();
}

}  // namespace vsplat

#include "runtime/profile/profile_sums.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <tuple>

namespace vsplat {
namespace {

// An interval of activity. If several are active, time counts for the first in the order of WallPart, given by `rank`;
// `rank` is device for everything that the device runs.
struct Stretch {
  std::uint64_t start, end;
  WallPart rank, part;
  std::size_t stage, host_row;  // host_row: none_row if it is no span of the host
};
constexpr std::size_t none_row = SIZE_MAX;

WallPart part_of(HostKind kind) {
  switch (kind) {
    case HostKind::host:
      return WallPart::host;
    case HostKind::file:
      return WallPart::file;
    case HostKind::compile:
      return WallPart::compile;
    case HostKind::upload:
      return WallPart::upload;
    case HostKind::wait:
      return WallPart::wait;
  }
  return WallPart::other;
}

// The activity within the profile's windows, with stages and host rows as indices.
class Stretches {
 public:
  explicit Stretches(const Profile& profile) : profile_(profile) {
    stage("");
    for (const ProfileLaunch& launch : profile.launches) add(launch);
    for (const HostRecord& record : profile.host) add(record);
  }

  std::vector<Stretch> all;
  std::vector<StageTotal> stages;
  std::vector<HostRow> rows;

 private:
  std::size_t stage(const std::string& name) {
    const auto [at, fresh] = stage_index_.emplace(name, stages.size());
    if (fresh) {
      stages.emplace_back();
      stages.back().stage = name;
    }
    return at->second;
  }

  std::size_t row(HostKind kind, const std::string& name) {
    const auto [at, fresh] = row_index_.emplace(std::make_pair(kind, name), rows.size());
    if (fresh) rows.push_back({kind, name});
    return at->second;
  }

  // Returns the length of the interval within the windows.
  std::uint64_t put(std::uint64_t start, std::uint64_t end, WallPart rank, WallPart part, std::size_t stage,
                    std::size_t host_row) {
    std::uint64_t length = 0;
    for (const ProfileWindow& window : profile_.windows) {
      const std::uint64_t from = std::max(start, window.start), to = std::min(end, window.end);
      if (from >= to) continue;
      all.push_back({from, to, rank, part, stage, host_row});
      length += to - from;
    }
    return length;
  }

  void add(const ProfileLaunch& launch) {
    const ProfileRow& of = profile_.rows[launch.row];
    const std::size_t in = stage(of.stage);
    const bool upload = of.name == "write" && of.stage == "transfer";
    put(launch.start, launch.end, WallPart::device, upload ? WallPart::upload : WallPart::device, in, none_row);
    if (!launch.prepared || launch.ready >= launch.start) return;
    const std::size_t at = row(HostKind::compile, "first launches");
    const std::uint64_t length = put(launch.ready, launch.start, WallPart::compile, WallPart::compile, in, at);
    if (length == 0) return;
    rows[at].total_ns += length;
    ++rows[at].calls;
  }

  void add(const HostRecord& record) {
    const std::size_t in = stage(record.stage), at = row(record.kind, record.name);
    const WallPart part = part_of(record.kind);
    const std::uint64_t length = put(record.start, record.end, part, part, in, at);
    if (length == 0) return;
    rows[at].total_ns += length;
    ++rows[at].calls;
  }

  const Profile& profile_;
  std::map<std::string, std::size_t> stage_index_;
  std::map<std::pair<HostKind, std::string>, std::size_t> row_index_;
};

}  // namespace

const char* name_of(WallPart part) {
  constexpr const char* names[kWallParts] = {"device", "compile", "upload", "file", "wait", "host", "other"};
  return names[static_cast<std::size_t>(part)];
}

std::uint64_t sum_of(const WallParts& parts) { return std::accumulate(parts.begin(), parts.end(), std::uint64_t{0}); }

std::uint64_t wall_ns(const Profile& profile) {
  std::uint64_t out = 0;
  for (const ProfileWindow& window : profile.windows) out += window.end - window.start;
  return out;
}

std::uint64_t launches_ns(const Profile& profile) {
  std::uint64_t out = 0;
  for (const ProfileRow& row : profile.rows) out += row.total_ns;
  return out;
}

// Between two consecutive beginnings or ends, time counts for the active interval of the lowest rank; of several, for
// the one that began last.
WallSplit split_wall(const Profile& profile) {
  Stretches stretches(profile);
  const std::vector<Stretch>& all = stretches.all;
  struct Change {
    std::uint64_t at;
    bool begins;
    std::size_t which;
  };
  std::vector<Change> changes;
  changes.reserve(2 * all.size() + 2 * profile.windows.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    changes.push_back({all[i].start, true, i});
    changes.push_back({all[i].end, false, i});
  }
  const std::size_t window = all.size();
  for (const ProfileWindow& w : profile.windows) {
    changes.push_back({w.start, true, window});
    changes.push_back({w.end, false, window});
  }
  std::stable_sort(changes.begin(), changes.end(), [](const Change& a, const Change& b) { return a.at < b.at; });

  WallSplit out;
  std::array<std::set<std::pair<std::uint64_t, std::size_t>>, kWallParts> at_work;
  std::vector<std::uint64_t> began(stretches.stages.size(), UINT64_MAX);
  int windows = 0;
  std::uint64_t before = changes.empty() ? 0 : changes.front().at;
  const auto pass = [&](std::uint64_t until) {
    const std::uint64_t length = until - before;
    if (length == 0 || windows == 0) return;
    const auto first = std::find_if(at_work.begin(), at_work.end(), [](const auto& rank) { return !rank.empty(); });
    const Stretch* winner = first == at_work.end() ? nullptr : &all[first->rbegin()->second];
    const auto part = static_cast<std::size_t>(winner ? winner->part : WallPart::other);
    out.parts[part] += length;
    stretches.stages[winner ? winner->stage : 0].parts[part] += length;
    if (winner && winner->host_row != none_row) stretches.rows[winner->host_row].self_ns += length;
  };
  for (const Change& change : changes) {
    pass(change.at);
    before = change.at;
    if (change.which == window) {
      windows += change.begins ? 1 : -1;
      continue;
    }
    const Stretch& s = all[change.which];
    auto& rank = at_work[static_cast<std::size_t>(s.rank)];
    if (change.begins) {
      rank.emplace(s.start, change.which);
      began[s.stage] = std::min(began[s.stage], s.start);
    } else {
      rank.erase({s.start, change.which});
    }
  }

  for (const ProfileRow& row : profile.rows)
    for (StageTotal& total : stretches.stages)
      if (total.stage == row.stage) total.launches_ns += row.total_ns;
  std::vector<std::size_t> order(stretches.stages.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return began[a] < began[b]; });
  for (const std::size_t i : order)
    if (sum_of(stretches.stages[i].parts) > 0 || stretches.stages[i].launches_ns > 0)
      out.stages.push_back(std::move(stretches.stages[i]));
  out.host = std::move(stretches.rows);
  std::stable_sort(out.host.begin(), out.host.end(),
                   [](const HostRow& a, const HostRow& b) { return a.self_ns > b.self_ns; });
  return out;
}

const char* name_of(Bound bound) {
  switch (bound) {
    case Bound::none:
      return "none";
    case Bound::compute:
      return "compute";
    case Bound::memory:
      return "memory";
    case Bound::latency:
      return "latency";
  }
  return "?";
}

Roofline roofline_of(const ProfileRow& row, const Peaks& peaks) {
  if (peaks.gflops <= 0 || peaks.gbs <= 0 || row.calls == 0) return {};
  const double compute_ns = row.performed_flops / peaks.gflops, memory_ns = row.bytes / peaks.gbs;
  const double least_ns = std::max(compute_ns, memory_ns);
  if (least_ns <= 0) return {};
  Roofline out;
  out.share_of_peak = row.total_ns > 0 ? least_ns / static_cast<double>(row.total_ns) : 0;
  out.bound = least_ns < 1e3 * peaks.launch_us * static_cast<double>(row.calls) ? Bound::latency
              : compute_ns >= memory_ns                                         ? Bound::compute
                                                                                : Bound::memory;
  return out;
}

std::int64_t clock_offset(const std::vector<QueuedAt>& queued) {
  if (queued.empty()) return 0;
  const auto least = [](const QueuedAt& q) { return static_cast<std::int64_t>(q.device - q.after); };
  const auto most = [](const QueuedAt& q) { return static_cast<std::int64_t>(q.device - q.before); };
  std::int64_t low = INT64_MIN, high = INT64_MAX;
  for (const QueuedAt& q : queued) {
    low = std::max(low, least(q));
    high = std::min(high, most(q));
  }
  if (low <= high) return low + (high - low) / 2;
  // The clocks drift, or the driver's times are inaccurate: take the median of the samples' middles.
  std::vector<std::int64_t> middles;
  middles.reserve(queued.size());
  for (const QueuedAt& q : queued) middles.push_back(least(q) + (most(q) - least(q)) / 2);
  const auto middle = middles.begin() + static_cast<std::ptrdiff_t>(middles.size() / 2);
  std::nth_element(middles.begin(), middle, middles.end());
  return *middle;
}

}  // namespace vsplat

// What a run of the benchmarks found, for people and for machines.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "bench/bench.h"

namespace vsplat::bench {

std::string table(const Comparison& compared);

const char* name_of(Kind kind) {
  switch (kind) {
    case Kind::compute:
      return "compute";
    case Kind::memory:
      return "memory";
    case Kind::operation:
      return "operation";
    case Kind::forward:
      return "forward";
    case Kind::backward:
      return "backward";
    case Kind::training:
      return "training";
    case Kind::fitting:
      return "fitting";
    case Kind::network:
      return "network";
  }
  return "?";
}

std::string table(const Report& report) {
  std::string out = fmt::format("{} ({}), {} kernels: {:.1f} GFLOP/s, {:.1f} GB/s at the most (measured)\n",
                                report.device, report.driver, report.kernels, report.peak_gflops, report.peak_gbs);
  if (!report.references.empty()) out += report.references + "\n";
  out += fmt::format("{:<28}{:>12}{:>9}{:>11}{:>9}{:>9}  {:<9}\n", "case", "median", "spread", "GFLOP/s", "GB/s",
                     "share", "of");
  for (const Result& r : report.results) {
    out += fmt::format("{:<28}{:>9.3f} ms{:>8.1f}%{:>11.1f}{:>9.1f}{:>8.1f}%  {:<9}", r.suite + "/" + r.name,
                       r.median_s * 1e3, r.spread * 100, r.gflops, r.gbs, r.share_of_peak * 100, name_of(r.kind));
    for (const auto& [stage, share] : r.stages) out += fmt::format("{} {:.1f}%  ", stage, share * 100);
    for (const auto& [library, seconds] : r.reference)
      out += fmt::format("{} {:.3f} ms ({:.2f}x)", library, seconds * 1e3, seconds / r.median_s);
    out += "\n";
    for (const StageTime& stage : r.by_stage)
      out += fmt::format("  {:<24}{:>12.3f} ms{:>20.1f}{:>9.1f}{:>8.1f}%  {}\n", stage.name, stage.seconds * 1e3,
                         stage.gflops, stage.gbs, 100 * stage.limit_s / stage.seconds, name_of(stage.limit));
    for (std::size_t i = 0; i < std::min<std::size_t>(r.kernels.size(), 40); ++i) {
      const KernelTime& k = r.kernels[i];
      out += fmt::format("  {:<12}{:<32}{:>6.0f} x{:>10.3f} ms{:>10.1f} GFLOP/s{:>8.1f} GB/s\n", k.stage, k.name,
                         k.calls, k.seconds * 1e3, k.gflops, k.gbs);
    }
  }
  if (report.compared) out += "\n" + table(*report.compared);
  return out;
}

std::string table(const Comparison& compared) {
  std::string out = fmt::format("{:<28}{:>12}{:>12}{:>10}{:>9}{:>16}  {}\n", "against " + compared.file, "before",
                                "now", "change", "noise", "share of peak", "verdict");
  for (const ComparedCase& c : compared.cases) {
    if (c.verdict == "new") {
      out += fmt::format("{:<28}{:>12}{:>9.3f} ms{:>10}{:>9}{:>15.1f}%  new\n", c.suite + "/" + c.name, "-",
                         c.after_s * 1e3, "", "", c.after_share * 100);
      continue;
    }
    out += fmt::format("{:<28}{:>9.3f} ms{:>9.3f} ms{:>+9.1f}%{:>8.1f}%{:>8.1f} -> {:.1f}%  {}\n",
                       c.suite + "/" + c.name, c.before_s * 1e3, c.after_s * 1e3, c.slower_by * 100, c.noise * 100,
                       c.before_share * 100, c.after_share * 100, c.verdict);
  }
  if (compared.not_run) out += fmt::format("{} cases of it were not run\n", compared.not_run);
  for (const std::string& what : compared.differ) out += what + "\n";
  return out;
}

std::string json(const Report& report) {
  nlohmann::ordered_json j;
  j["device"] = report.device;
  j["driver"] = report.driver;
  j["kernels"] = report.kernels;
  j["tuning"] = report.tuning.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(report.tuning);
  j["precision"] = report.precision;
  j["peak_gflops"] = report.peak_gflops;
  j["peak_gbs"] = report.peak_gbs;
  j["results"] = nlohmann::ordered_json::array();
  if (!report.references.empty()) j["references"] = report.references;
  for (const Result& r : report.results) {
    nlohmann::ordered_json entry = {{"suite", r.suite},
                                    {"name", r.name},
                                    {"kind", name_of(r.kind)},
                                    {"median_s", r.median_s},
                                    {"spread", r.spread},
                                    {"gflops", r.gflops},
                                    {"performed_gflops", r.performed_gflops},
                                    {"gbs", r.gbs},
                                    {"share_of_peak", r.share_of_peak},
                                    {"error", r.error ? nlohmann::ordered_json(*r.error) : nlohmann::ordered_json()},
                                    {"reference", r.reference},
                                    {"least_s", r.least_s}};
    if (!r.stages.empty()) entry["stages"] = r.stages;
    for (const KernelTime& k : r.kernels)
      entry["kernels"].push_back({{"stage", k.stage},
                                  {"name", k.name},
                                  {"calls", k.calls},
                                  {"seconds", k.seconds},
                                  {"gflops", k.gflops},
                                  {"gbs", k.gbs}});
    for (const StageTime& stage : r.by_stage)
      entry["by_stage"].push_back({{"stage", stage.name},
                                   {"seconds", stage.seconds},
                                   {"gflops", stage.gflops},
                                   {"performed_gflops", stage.performed_gflops},
                                   {"gbs", stage.gbs},
                                   {"limit", name_of(stage.limit)},
                                   {"limit_s", stage.limit_s},
                                   {"share_of_limit", stage.limit_s / stage.seconds}});
    j["results"].push_back(std::move(entry));
  }
  if (report.compared) {
    nlohmann::ordered_json cases = nlohmann::ordered_json::array();
    for (const ComparedCase& c : report.compared->cases) {
      const bool old = c.verdict != "new";
      const auto of_old = [&](double v) { return old ? nlohmann::ordered_json(v) : nlohmann::ordered_json(); };
      cases.push_back({{"suite", c.suite},
                       {"name", c.name},
                       {"verdict", c.verdict},
                       {"before_s", of_old(c.before_s)},
                       {"after_s", c.after_s},
                       {"slower_by", of_old(c.slower_by)},
                       {"noise", of_old(c.noise)},
                       {"before_share", of_old(c.before_share)},
                       {"after_share", c.after_share}});
    }
    j["compared"] = {{"file", report.compared->file},
                     {"cases", cases},
                     {"not_run", report.compared->not_run},
                     {"differ", report.compared->differ}};
  }
  return j.dump(2) + "\n";
}

}  // namespace vsplat::bench

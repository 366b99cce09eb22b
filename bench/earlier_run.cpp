#include "bench/earlier_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "runtime/fail.h"
#include "runtime/files/file.h"

namespace vsplat::bench {
namespace {

using Json = nlohmann::json;

constexpr double kLeastNoise = 0.03;  // runs of a few seconds differ by so much on a machine that does nothing else
constexpr double kOtherPeak = 0.05;   // peaks that differ by more tell of another machine, or of other work on it

[[noreturn]] void no_report(const std::string& path, const std::string& what) {
  fail(Status::format, "{}: is no report as vsplat bench writes it as JSON: {}", path, what);
}

const Json& field(const std::string& path, const Json& of, std::string_view where, const char* name) {
  if (!of.is_object() || !of.contains(name)) no_report(path, std::string(where) + name + " is not there");
  return of[name];
}

double number(const std::string& path, const Json& of, const std::string& where, const char* name) {
  const Json& value = field(path, of, where, name);
  if (!value.is_number() || !std::isfinite(value.get<double>()) || value.get<double>() < 0)
    no_report(path, where + name + " is no number of 0 or more");
  return value.get<double>();
}

std::string text(const std::string& path, const Json& of, const std::string& where, const char* name) {
  const Json& value = field(path, of, where, name);
  if (!value.is_string()) no_report(path, where + name + " is no text");
  return value.get<std::string>();
}

// Some cases share a name: a scene's drawing, and its derivative.
template <class Case>
int times_named(const std::vector<Case>& cases, const std::string& suite, const std::string& name) {
  return static_cast<int>(
      std::count_if(cases.begin(), cases.end(), [&](const Case& c) { return c.suite == suite && c.name == name; }));
}

}  // namespace

EarlierReport read_report(const std::string& path) {
  const auto bytes = read_file(path);
  const Json report = Json::parse(bytes.begin(), bytes.end(), nullptr, false);
  if (report.is_discarded() || !report.is_object()) no_report(path, "it is no JSON object");
  EarlierReport out;
  out.path = path;
  out.device = text(path, report, "", "device"), out.driver = text(path, report, "", "driver");
  out.kernels = text(path, report, "", "kernels");
  if (report.contains("tuning") && report["tuning"].is_string()) out.tuning = report["tuning"].get<std::string>();
  out.peak_gflops = number(path, report, "", "peak_gflops"), out.peak_gbs = number(path, report, "", "peak_gbs");
  const Json& results = field(path, report, "", "results");
  if (!results.is_array()) no_report(path, "results is no list");
  for (std::size_t i = 0; i < results.size(); ++i) {
    const std::string where = fmt::format("results[{}].", i);
    EarlierCase c;
    c.suite = text(path, results[i], where, "suite"), c.name = text(path, results[i], where, "name");
    c.number = times_named(out.cases, c.suite, c.name);
    c.median_s = number(path, results[i], where, "median_s");
    c.spread = number(path, results[i], where, "spread");
    c.share_of_peak = number(path, results[i], where, "share_of_peak");
    if (!(c.median_s > 0)) no_report(path, where + "median_s is 0");
    out.cases.push_back(std::move(c));
  }
  return out;
}

Comparison compare(const EarlierReport& before, const Report& now) {
  Comparison out;
  out.file = before.path;
  const auto differs = [&](const char* what, const std::string& a, const std::string& b) {
    if (a != b)
      out.differ.push_back(fmt::format("{}: {} before, {} now", what, a.empty() ? "none" : a, b.empty() ? "none" : b));
  };
  differs("device", before.device, now.device);
  differs("driver", before.driver, now.driver);
  differs("kernels", before.kernels, now.kernels);
  differs("table of tuned parameters", before.tuning, now.tuning);
  const auto moved = [&](const char* what, double a, double b, const char* unit) {
    if (a > 0 && std::abs(b / a - 1) > kOtherPeak)
      out.differ.push_back(fmt::format(
          "measured {}: {:.1f} {} before, {:.1f} now: shares of it compare better than times", what, a, unit, b));
  };
  moved("peak of arithmetic", before.peak_gflops, now.peak_gflops, "GFLOP/s");
  moved("peak of memory", before.peak_gbs, now.peak_gbs, "GB/s");
  std::vector<Result> seen;
  for (const Result& r : now.results) {
    const int number = times_named(seen, r.suite, r.name);
    seen.push_back(r);
    const auto old = std::find_if(before.cases.begin(), before.cases.end(), [&](const EarlierCase& c) {
      return c.suite == r.suite && c.name == r.name && c.number == number;
    });
    ComparedCase c;
    c.suite = r.suite, c.name = r.name, c.after_s = r.median_s, c.after_share = r.share_of_peak;
    if (old == before.cases.end()) {
      c.verdict = "new";
    } else {
      c.before_s = old->median_s, c.before_share = old->share_of_peak;
      c.noise = std::max({kLeastNoise, old->spread, r.spread});
      c.slower_by = r.median_s / old->median_s - 1;
      c.verdict = c.slower_by > c.noise ? "slower" : old->median_s / r.median_s - 1 > c.noise ? "faster" : "same";
    }
    out.cases.push_back(std::move(c));
  }
  out.not_run = before.cases.size() +
                static_cast<std::size_t>(std::count_if(out.cases.begin(), out.cases.end(),
                                                       [](const auto& c) { return c.verdict == "new"; })) -
                out.cases.size();
  return out;
}

}  // namespace vsplat::bench

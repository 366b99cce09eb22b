#include "bench/bench.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

namespace vsplat::bench {

namespace {

double seconds_of(Context& ctx, const std::function<void()>& run) {
  const auto start = std::chrono::steady_clock::now();
  run();
  ctx.finish();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct Times {
  double median, spread, least;
};

// Runs at least three times, and for `budget` seconds; the first run, which compiles, is not counted.
Times time(Context& ctx, const std::function<void()>& run, double budget) {
  run();
  ctx.finish();
  std::vector<double> times;
  double spent = 0;
  while (times.size() < 3 || (spent < budget && times.size() < 1000)) {
    times.push_back(seconds_of(ctx, run));
    spent += times.back();
  }
  std::sort(times.begin(), times.end());
  const auto at = [&](double share) { return times[static_cast<std::size_t>(share * (times.size() - 1) + 0.5)]; };
  return {at(0.5), (at(0.75) - at(0.25)) / at(0.5), times.front()};
}

// One work-item's vectors are one register tile of the cpu flavour; a gpu wants many work-items instead.
double measure_gflops(Context& ctx) {
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const int width = cpu ? 16 : 4, chains = cpu ? 24 : 8, steps = cpu ? 100000 : 2000;
  const long work_items = static_cast<long>(ctx.device().compute_units) * (cpu ? 8 : 4096);
  const Tensor out = ctx.tensor({work_items, width});
  const Cost cost{2.0 * width * chains * steps * static_cast<double>(work_items), 0};
  const KernelId kernel{"peak", "peak_fma", fmt::format("-DWIDTH={} -DCHAINS={}", width, chains)};
  const auto run = [&] { ctx.launch(kernel, items(work_items, cpu ? 1 : 64), cost, steps, 0.9f, out); };
  return cost.flops / time(ctx, run, 0.2).least / 1e9;
}

double measure_gbs(Context& ctx) {
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const int width = cpu ? 16 : 4, n = (cpu ? 16 : 64) << 20 >> (cpu ? 4 : 2);
  const std::vector<float> ones(static_cast<std::size_t>(n) * static_cast<std::size_t>(width), 1.0f);
  const Tensor a = ctx.upload({n, width}, ones), b = ctx.upload({n, width}, ones), y = ctx.tensor({n, width});
  const Cost cost{0, 3.0 * static_cast<double>(a.bytes())};
  const KernelId kernel{"peak", "peak_stream", fmt::format("-DWIDTH={}", width)};
  const auto run = [&] { ctx.launch(kernel, items(n, cpu ? 256 : 64), cost, n, 0.5f, a, b, y); };
  return cost.bytes / time(ctx, run, 0.2).least / 1e9;
}

struct Suite {
  const char* name;
  std::vector<Case> (*cases)();
};
const std::vector<Suite> kSuites = {{"gemm", gemm_cases}, {"conv", conv_cases}};

Result run_case(Context& ctx, const std::string& suite, const Case& c, const Options& options) {
  const Prepared p = c.prepare(ctx);
  Result r;
  r.suite = suite, r.name = c.name, r.kind = p.memory_bound ? "memory" : "compute";
  p.run();
  r.error = p.error();
  if (!(r.error <= p.tolerance))
    fail(Status::internal, "bench {}/{}: off by {:.2g} of the largest value, at most {:.2g} expected", suite, c.name,
         r.error, p.tolerance);
  const Times t = time(ctx, p.run, options.seconds);
  r.median_s = t.median, r.spread = t.spread;
  r.gflops = p.cost.flops / t.median / 1e9;
  r.performed_gflops = (p.performed_flops > 0 ? p.performed_flops : p.cost.flops) / t.median / 1e9;
  r.gbs = p.cost.bytes / t.median / 1e9;
  if (options.references)
    for (const auto& [library, run] : p.references) r.reference[library] = time(ctx, run, options.seconds).median;
  return r;
}

}  // namespace

std::vector<std::string> suite_names() {
  std::vector<std::string> names;
  for (const Suite& s : kSuites) names.push_back(s.name);
  return names;
}

Report run(Context& ctx, const Options& options) {
  for (const std::string& name : options.suites)
    if (std::none_of(kSuites.begin(), kSuites.end(), [&](const Suite& s) { return name == s.name; }))
      fail(Status::usage, "no suite \"{}\" to bench; there is: {}", name, fmt::join(suite_names(), ", "));
  Report report;
  report.device = ctx.device().name, report.driver = ctx.device().driver, report.kernels = name_of(ctx.flavour());
  // Measured before and after, since other load on the machine may take from either.
  report.peak_gflops = measure_gflops(ctx);
  report.peak_gbs = measure_gbs(ctx);
  for (const Suite& suite : kSuites) {
    const auto& asked = options.suites;
    if (!asked.empty() && std::find(asked.begin(), asked.end(), suite.name) == asked.end()) continue;
    for (const Case& c : suite.cases()) {
      const std::string full = fmt::format("{}/{}", suite.name, c.name);
      if (full.find(options.filter) == std::string::npos) continue;
      if (options.on_case) options.on_case(full);
      report.results.push_back(run_case(ctx, suite.name, c, options));
    }
  }
  report.peak_gflops = std::max(report.peak_gflops, measure_gflops(ctx));
  report.peak_gbs = std::max(report.peak_gbs, measure_gbs(ctx));
  for (Result& r : report.results)
    r.share_of_peak = r.kind == "memory" ? r.gbs / report.peak_gbs : r.performed_gflops / report.peak_gflops;
  return report;
}

std::string table(const Report& report) {
  std::string out = fmt::format("{} ({}), {} kernels: {:.1f} GFLOP/s, {:.1f} GB/s at the most (measured)\n",
                                report.device, report.driver, report.kernels, report.peak_gflops, report.peak_gbs);
  out += fmt::format("{:<28}{:>12}{:>9}{:>11}{:>9}{:>9}  {:<8}\n", "case", "median", "spread", "GFLOP/s", "GB/s",
                     "share", "of");
  for (const Result& r : report.results) {
    out += fmt::format("{:<28}{:>9.3f} ms{:>8.1f}%{:>11.1f}{:>9.1f}{:>8.1f}%  {:<8}", r.suite + "/" + r.name,
                       r.median_s * 1e3, r.spread * 100, r.gflops, r.gbs, r.share_of_peak * 100, r.kind);
    for (const auto& [library, seconds] : r.reference)
      out += fmt::format("{} {:.3f} ms ({:.2f}x)", library, seconds * 1e3, seconds / r.median_s);
    out += "\n";
  }
  return out;
}

std::string json(const Report& report) {
  nlohmann::ordered_json j;
  j["device"] = report.device;
  j["driver"] = report.driver;
  j["kernels"] = report.kernels;
  j["peak_gflops"] = report.peak_gflops;
  j["peak_gbs"] = report.peak_gbs;
  j["results"] = nlohmann::ordered_json::array();
  for (const Result& r : report.results)
    j["results"].push_back({{"suite", r.suite},
                            {"name", r.name},
                            {"kind", r.kind},
                            {"median_s", r.median_s},
                            {"spread", r.spread},
                            {"gflops", r.gflops},
                            {"performed_gflops", r.performed_gflops},
                            {"gbs", r.gbs},
                            {"share_of_peak", r.share_of_peak},
                            {"error", r.error},
                            {"reference", r.reference}});
  return j.dump(2) + "\n";
}

}  // namespace vsplat::bench

#include "bench/bench.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <set>

#include "bench/references.h"
#include "bench/timing.h"
#include "model/diagnose/selftest/cases/cases.h"
#include "runtime/fail.h"
#include "runtime/profile/peaks.h"
#include "runtime/profile/profile_page.h"
#include "runtime/profile/profiler.h"

namespace vsplat::bench {

namespace {

// What a kernel does for a pass, from its name.
std::string stage_of(const std::string& kernel) {
  // The first that fits.
  static const std::pair<const char*, const char*> families[] = {{"project_backward", "project_backward"},
                                                                 {"project_surfels_backward", "project_backward"},
                                                                 {"project_surfels_cull", "cull"},
                                                                 {"project_cull", "cull"},
                                                                 {"project", "project"},
                                                                 {"visible", "cull"},
                                                                 {"radix_", "sort"},
                                                                 {"scan_", "sort"},
                                                                 {"tile_bin", "bin"},
                                                                 {"rasterize_backward", "rasterize_backward"},
                                                                 {"rasterize_surfels_backward", "rasterize_backward"},
                                                                 {"rasterize", "rasterize"},
                                                                 {"area_mean", "rasterize"},
                                                                 {"loss_", "loss"},
                                                                 {"picture_target", "loss"},
                                                                 {"splat_", "optimiser"},
                                                                 {"read", "transfer"},
                                                                 {"write", "transfer"},
                                                                 {"copy", "transfer"},
                                                                 {"fill", "transfer"}};
  for (const auto& [prefix, stage] : families)
    if (kernel.rfind(prefix, 0) == 0) return stage;
  return kernel;
}

struct Profiled {
  double seconds = 0;  // of one run, on average, with the profiler on
  Cost cost;           // likewise
  std::map<std::string, double> stages;
  std::vector<KernelTime> kernels;
};

// Every input once more, with the profiler on. Gathering times takes time, so shares are of a run without it,
// `seconds`; 0: none was timed.
Profiled profile(Context& ctx, const Prepared& p, double seconds) {
  Profiler& profiler = ctx.profiler();
  const bool enabled = profiler.enabled();
  std::map<std::string, ProfileRow> before;  // the user may be profiling the whole run
  for (const ProfileRow& row : profiler.rows()) before[row.stage + "/" + row.name] = row;
  profiler.enable(true);
  Profiled out;
  for (int i = 0; i < p.inputs; ++i) out.seconds += seconds_of(ctx, p.run) / p.inputs;
  profiler.enable(enabled);
  if (!(seconds > 0)) seconds = out.seconds;
  double in_kernels = 0;
  for (const ProfileRow& row : profiler.rows()) {
    const ProfileRow& old = before[row.stage + "/" + row.name];
    if (row.calls == old.calls) continue;
    const double each = static_cast<double>(row.total_ns - old.total_ns) * 1e-9 / p.inputs;
    // A training's stages are the network's; where none is at work, weights are.
    const std::string stage = !row.stage.empty() ? row.stage : p.kind == Kind::network ? "other" : "weights";
    out.stages[p.kind == Kind::training || p.kind == Kind::network ? stage : stage_of(row.name)] += each;
    in_kernels += each;
    const Cost cost{(row.flops - old.flops) / p.inputs, (row.bytes - old.bytes) / p.inputs,
                    (row.performed_flops - old.performed_flops) / p.inputs};
    out.cost.flops += cost.flops;
    out.cost.bytes += cost.bytes;
    out.cost.performed += cost.performed;
    if (p.kind >= Kind::training)
      out.kernels.push_back({stage, row.name, static_cast<double>(row.calls - old.calls) / p.inputs, each,
                             cost.flops / each / 1e9, cost.bytes / each / 1e9, cost.performed / each / 1e9});
  }
  std::sort(out.kernels.begin(), out.kernels.end(),
            [](const KernelTime& a, const KernelTime& b) { return a.seconds > b.seconds; });
  out.stages["host"] = std::max(0.0, seconds - in_kernels);
  for (auto& [stage, share] : out.stages) share /= std::max(seconds, in_kernels);
  return out;
}

// Fails where a result is wrong.
void hold(const std::string& name, double error, double tolerance) {
  if (!(error <= tolerance))
    fail(Status::internal, "bench {}: off by {:.2g} of the largest value, at most {:.2g} expected", name, error,
         tolerance);
}

// That the result of a run is right, or looks like one.
void check(const Prepared& p, const std::string& name, Result& r) {
  if (p.look && !p.look())
    fail(Status::internal, "bench {}: what it computed is not all numbers, or nothing but zeros", name);
  if (!p.error) return;
  r.error = p.error();
  hold(name, *r.error, p.tolerance);
}

// What is going on, and how many seconds the case still takes; below 0 where that is not known.
using Tell = std::function<void(const std::string& doing, double left_s)>;

Result run_case(Context& ctx, const std::string& suite, const Case& c, const Options& options, const Tell& tell) {
  const std::string full = suite + "/" + c.name;
  tell("preparing", -1);
  const Prepared p = c.prepare(ctx);
  Result r;
  r.suite = suite, r.name = c.name, r.kind = p.kind;
  const bool profiled_too = is_pass(p.kind) || p.kind == Kind::operation;
  // Where no time is given, the profile's run is the only one.
  const bool once = options.seconds <= 0 && profiled_too && (!options.references || p.references.empty());
  tell("first run", -1);
  Profiled profiled;
  if (once)
    profiled = profile(ctx, p, 0);
  else
    p.run();
  tell("checking", -1);
  check(p, options.model.empty() ? full : full + " with " + options.model, r);
  std::vector<Timed> timed = {{p.run, p.inputs}};
  if (options.references)
    for (const auto& [library, other] : p.references) {
      tell("checking " + library, -1);
      other.run();
      if (other.error) hold(full + " by " + library, other.error(), p.tolerance);
      timed.push_back({other.run});
    }
  std::vector<Times> times = {{profiled.seconds, 0, profiled.seconds, profiled.seconds}};
  if (!once)
    times = time_by_turns(
        ctx, timed, {options.seconds, [&](int round, double left) { tell(fmt::format("run {}", round), left); }}, true);
  const Times& t = times[0];
  Cost cost = p.cost;
  if (profiled_too) {
    tell("profile", t.mean);
    if (!once) profiled = profile(ctx, p, t.mean);
    cost = profiled.cost;
    if (is_pass(p.kind)) r.stages = profiled.stages;
    r.kernels = profiled.kernels;
  }
  r.median_s = t.median, r.spread = t.spread, r.least_s = t.least;
  r.gflops = cost.flops / t.median / 1e9;
  r.performed_gflops = (p.performed_flops > 0 ? p.performed_flops
                        : cost.performed > 0  ? cost.performed
                                              : cost.flops) /
                       t.median / 1e9;
  r.gbs = cost.bytes / t.median / 1e9;
  if (options.references) {
    std::size_t at = 0;
    for (const auto& [library, other] : p.references) r.reference[library] = times[++at].median;
    if (p.others) {
      tell("other programs", -1);
      r.reference.merge(p.others());
    }
  }
  return r;
}

// An operation's case of the self-test: it is right before it is timed. Mixed precision has other tolerances.
void check_operation(Context& ctx, const std::string& name) {
  if (ctx.precision() != Precision::fp32) return;
  const bool profiled = ctx.profiler().enabled();
  ctx.profiler().enable(false);
  selftest::Checks checks(ctx, selftest::Sizes::quick);
  for (const selftest::Case& one : selftest::cases_of(name)) checks.run(one.name, one.run);
  ctx.profiler().enable(profiled);
  for (const selftest::Finding& f : checks.findings())
    if (!f.right)
      fail(Status::internal, "bench {}: {} is off by {:.2g} of the largest value, at most {:.2g} expected {}", name,
           f.what, f.error, f.tolerance, f.trouble);
}

// What was asked for, in order.
std::vector<std::pair<std::string, Case>> chosen(const Options& options) {
  std::vector<std::pair<std::string, Case>> out;
  const auto& asked = options.suites;
  for (const auto& list : {suites(), operation_suites()})
    for (const Suite& suite : list) {
      if (!asked.empty() && std::find(asked.begin(), asked.end(), suite.name) == asked.end()) continue;
      for (const Case& c : suite.cases(options))
        if (fmt::format("{}/{}", suite.name, c.name).find(options.filter) != std::string::npos)
          out.emplace_back(suite.name, c);
    }
  return out;
}

void run_all(Context& ctx, const Options& options, Report& report) {
  const auto cases = chosen(options);
  const auto start = std::chrono::steady_clock::now();
  std::set<std::string> checked;
  for (std::size_t at = 0; at < cases.size(); ++at) {
    const auto& [suite, c] = cases[at];
    const double so_far = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const auto tell = [&, full = suite + "/" + c.name](const std::string& doing, double left_of_case) {
      if (!options.on_progress) return;
      const double now = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      const auto done = static_cast<double>(at), all = static_cast<double>(cases.size());
      // The estimate assumes that a case takes as long as those before it, or as this one, plus the rest of the current
      // case.
      const double here = now - so_far, of_this = here + std::max(0.0, left_of_case);
      const double each = at == 0 ? of_this : so_far / done;
      const double rest = left_of_case >= 0 ? left_of_case : std::max(0.0, each - here);
      const double left = at == 0 && left_of_case < 0 ? -1 : each * (all - done - 1) + rest;
      // (Where one takes longer than those before did, nothing is known.)
      options.on_progress({full, doing, at, cases.size(), left > 0 ? left : -1});
    };
    if (checked.insert(suite).second) {
      tell("checking", -1);
      check_operation(ctx, suite);
    }
    report.results.push_back(run_case(ctx, suite, c, options, tell));
  }
}

// Each kernel could take no less time than the nearer of the two peaks allows.
std::vector<StageTime> by_stage(const Result& r, double peak_gflops, double peak_gbs) {
  struct Sums {
    double seconds = 0, flops = 0, performed = 0, bytes = 0, compute = 0, memory = 0;
  };
  std::map<std::string, Sums> sums;
  for (const KernelTime& k : r.kernels) {
    Sums& s = sums[k.stage];
    s.seconds += k.seconds;
    s.flops += k.gflops * k.seconds, s.performed += k.performed_gflops * k.seconds, s.bytes += k.gbs * k.seconds;
    const double compute = k.performed_gflops * k.seconds / peak_gflops, memory = k.gbs * k.seconds / peak_gbs;
    (compute >= memory ? s.compute : s.memory) += std::max(compute, memory);
  }
  std::vector<StageTime> out;
  out.reserve(sums.size());
  for (const auto& [name, s] : sums)
    out.push_back({name, s.seconds, s.compute + s.memory, s.flops / s.seconds, s.performed / s.seconds,
                   s.bytes / s.seconds, s.compute >= s.memory ? Kind::compute : Kind::memory});
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.seconds > b.seconds; });
  return out;
}

std::vector<std::string> names_of(const std::vector<Suite>& list) {
  std::vector<std::string> names;
  names.reserve(list.size());
  for (const Suite& s : list) names.emplace_back(s.name);
  return names;
}

}  // namespace

std::vector<std::string> suite_names() {
  std::vector<std::string> names = names_of(suites());
  for (const std::string& name : operation_names()) names.push_back(name);
  return names;
}

std::vector<std::string> operation_names() { return names_of(operation_suites()); }

Report run(Context& ctx, const Options& options) {
  const std::vector<std::string> known = suite_names();
  for (const std::string& name : options.suites)
    if (std::find(known.begin(), known.end(), name) == known.end())
      fail(Status::usage, "no suite \"{}\" to bench; there is: {}", name, fmt::join(known, ", "));
  Report report;
  report.tuning = ctx.tuning().hash(), report.precision = name_of(ctx.precision());
  report.device = ctx.device().name, report.driver = ctx.device().driver, report.kernels = name_of(ctx.flavour());
  // Measured before and after, since other load on the machine may take from either; a run that is given no time is not
  // worth much of it.
  const bool quick = options.seconds <= 0;
  report.peak_gflops = quick ? measure_gflops(ctx, 0) : measure_gflops(ctx);
  report.peak_gbs = quick ? measure_gbs(ctx, 0) : measure_gbs(ctx);
  if (options.references) report.references = References::about(ctx);
  run_all(ctx, options, report);
  if (!quick) {
    report.peak_gflops = std::max(report.peak_gflops, measure_gflops(ctx));
    report.peak_gbs = std::max(report.peak_gbs, measure_gbs(ctx));
  }
  for (Result& r : report.results) {
    const double of_memory = r.gbs / report.peak_gbs, of_compute = r.performed_gflops / report.peak_gflops;
    if (r.kind == Kind::operation) r.kind = of_memory > of_compute ? Kind::memory : Kind::compute;
    r.share_of_peak = is_pass(r.kind)          ? std::max(of_memory, of_compute)
                      : r.kind == Kind::memory ? of_memory
                                               : of_compute;
    if (r.kind == Kind::network) r.by_stage = by_stage(r, report.peak_gflops, report.peak_gbs);
  }
  return report;
}

void record(Context& ctx) { ctx.profiler().enable(true); }

Recorded recorded(Context& ctx) {
  ctx.finish();
  ctx.profiler().enable(false);
  const Profile profile = ctx.profiler().profile();
  const DeviceInfo& device = ctx.device();
  const ProfileSubject subject{device.name,   device.driver,       ctx.memory().peak(), {{"command", "bench"}},
                               peaks_of(ctx), ctx.tuning().hash(), ctx.precision()};
  return {profile_json(profile, subject), profile_page(profile, subject), profile_trace(profile)};
}

}  // namespace vsplat::bench

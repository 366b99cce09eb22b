#include "bench/bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include "runtime/fail.h"
#include "runtime/peaks.h"
#include "runtime/profile_page.h"
#include "runtime/profiler.h"

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
  double mean;  // over the inputs, of each one's median
};

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::lround(share * static_cast<double>(values.size() - 1)))];
}

// Runs with each input at least three times, and for `budget` seconds; the first run with each, which compiles and
// makes room, is not counted. Without a budget, once.
Times time(Context& ctx, const std::function<void()>& run, double budget, int inputs = 1) {
  for (int i = 0; budget > 0 && i < inputs; ++i) run();
  ctx.finish();
  std::vector<std::vector<double>> by_input(static_cast<std::size_t>(inputs));
  double spent = 0;
  for (int round = 0; round < (budget > 0 ? 3 : 1) || (spent < budget && round < 1000); ++round) {
    for (auto& times : by_input) {
      times.push_back(seconds_of(ctx, run));
      spent += times.back();
    }
  }
  // Inputs differ in what they take; what spreads is one input's time.
  std::vector<double> all, relative;
  double mean = 0;
  for (const auto& times : by_input) {
    all.insert(all.end(), times.begin(), times.end());
    mean += quantile(times, 0.5) / inputs;
    for (const double t : times) relative.push_back(t / quantile(times, 0.5));
  }
  return {quantile(all, 0.5), quantile(relative, 0.75) - quantile(relative, 0.25), quantile(all, 0), mean};
}

struct Suite {
  const char* name;
  std::vector<Case> (*cases)(const Options&);
};
const std::vector<Suite> kSuites = {{"gemm", gemm_cases},
                                    {"conv3d", conv3d_cases},
                                    {"render", render_cases},
                                    {"train", train_cases},
                                    {"refine", refine_cases}};
const std::vector<Suite> kOperations = {
    {"activation", activation_cases},
    {"adamw", adamw_cases},
    {"add_columns", add_columns_cases},
    {"attention", attention_cases},
    {"cell_map", cell_map_cases},
    {"compact", compact_cases},
    {"confidence", confidence_cases},
    {"conv3d_up", conv3d_up_cases},
    {"cross_attention", cross_attention_cases},
    {"decode", decode_cases},
    {"exposure", exposure_cases},
    {"gather", gather_cases},
    {"groupnorm", groupnorm_cases},
    {"lara_maps", lara_maps_cases},
    {"layer_scale", layer_scale_cases},
    {"layernorm", layernorm_cases},
    {"lift", lift_cases},
    {"loss", loss_cases},
    {"lpips", lpips_cases},
    {"muon", muon_cases},
    {"patch_embed", patch_embed_cases},
    {"picture_target", picture_target_cases},
    {"plucker", plucker_cases},
    {"position_encoding", position_encoding_cases},
    {"position_resample", position_resample_cases},
    {"project", project_cases},
    {"project_features", project_features_cases},
    {"project_surfels", project_surfels_cases},
    {"radix_sort", radix_sort_cases},
    {"rasterize", rasterize_cases},
    {"rasterize_surfels", rasterize_surfels_cases},
    {"ray_harmonics", ray_harmonics_cases},
    {"ray_loss", ray_loss_cases},
    {"rope", rope_cases},
    {"sample_points", sample_points_cases},
    {"scan", scan_cases},
    {"scatter_rows", scatter_rows_cases},
    {"select", select_cases},
    {"space_curve", space_curve_cases},
    {"sparse_conv", sparse_conv_cases},
    {"sparse_map", sparse_map_cases},
    {"splat_adam", splat_adam_cases},
    {"splat_parameters", splat_parameters_cases},
    {"splat_relocate", splat_relocate_cases},
    {"surface_loss", surface_loss_cases},
    {"tile_bin", tile_bin_cases},
    {"top_k", top_k_cases},
    {"transpose", transpose_cases},
    {"upsample3d", upsample3d_cases},
    {"upscale", upscale_cases},
    {"view_maps", view_maps_cases},
    {"visible", visible_cases},
};

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
  Cost cost;  // of one run, on average
  std::map<std::string, double> stages;
  std::vector<KernelTime> kernels;
};

// Every input once more, with the profiler on. Gathering times takes time, so shares are of a run without it,
// `seconds`.
Profiled profile(Context& ctx, const Prepared& p, double seconds) {
  Profiler& profiler = ctx.profiler();
  const bool enabled = profiler.enabled();
  std::map<std::string, ProfileRow> before;  // the user may be profiling the whole run
  for (const ProfileRow& row : profiler.rows()) before[row.stage + "/" + row.name] = row;
  profiler.enable(true);
  for (int i = 0; i < p.inputs; ++i) seconds_of(ctx, p.run);
  profiler.enable(enabled);
  Profiled out;
  double in_kernels = 0;
  for (const ProfileRow& row : profiler.rows()) {
    const ProfileRow& old = before[row.stage + "/" + row.name];
    if (row.calls == old.calls) continue;
    const double each = static_cast<double>(row.total_ns - old.total_ns) * 1e-9 / p.inputs;
    // A training's stages are the network's; where none is at work, weights are.
    const std::string stage = row.stage.empty() ? "weights" : row.stage;
    out.stages[p.kind == Kind::training ? stage : stage_of(row.name)] += each;
    in_kernels += each;
    const Cost cost{(row.flops - old.flops) / p.inputs, (row.bytes - old.bytes) / p.inputs,
                    (row.performed_flops - old.performed_flops) / p.inputs};
    out.cost.flops += cost.flops;
    out.cost.bytes += cost.bytes;
    out.cost.performed += cost.performed;
    if (p.kind == Kind::training || p.kind == Kind::fitting)
      out.kernels.push_back({stage, row.name, static_cast<double>(row.calls - old.calls) / p.inputs, each,
                             cost.flops / each / 1e9, cost.bytes / each / 1e9});
  }
  std::sort(out.kernels.begin(), out.kernels.end(),
            [](const KernelTime& a, const KernelTime& b) { return a.seconds > b.seconds; });
  out.stages["host"] = std::max(0.0, seconds - in_kernels);
  for (auto& [stage, share] : out.stages) share /= std::max(seconds, in_kernels);
  return out;
}

// That the result of a run is right, or looks like one.
void check(const Prepared& p, const std::string& name, Result& r) {
  if (p.look) {
    if (!p.look()) fail(Status::internal, "bench {}: what it computed is not all numbers, or nothing but zeros", name);
    return;
  }
  r.error = p.error();
  if (!(*r.error <= p.tolerance))
    fail(Status::internal, "bench {}: off by {:.2g} of the largest value, at most {:.2g} expected", name, *r.error,
         p.tolerance);
}

Result run_case(Context& ctx, const std::string& suite, const Case& c, const Options& options) {
  const Prepared p = c.prepare(ctx);
  Result r;
  r.suite = suite, r.name = c.name, r.kind = p.kind;
  p.run();
  check(p, suite + "/" + c.name, r);
  const Times t = time(ctx, p.run, options.seconds, p.inputs);
  Cost cost = p.cost;
  if (is_pass(p.kind) || p.kind == Kind::operation) {
    const Profiled profiled = profile(ctx, p, t.mean);
    cost = profiled.cost;
    if (is_pass(p.kind)) r.stages = profiled.stages;
    r.kernels = profiled.kernels;
  }
  r.median_s = t.median, r.spread = t.spread;
  r.gflops = cost.flops / t.median / 1e9;
  r.performed_gflops = (p.performed_flops > 0 ? p.performed_flops
                        : cost.performed > 0  ? cost.performed
                                              : cost.flops) /
                       t.median / 1e9;
  r.gbs = cost.bytes / t.median / 1e9;
  if (options.references)
    for (const auto& [library, run] : p.references) r.reference[library] = time(ctx, run, options.seconds).median;
  return r;
}

void run_suite(Context& ctx, const Suite& suite, const Options& options, Report& report) {
  const auto& asked = options.suites;
  if (!asked.empty() && std::find(asked.begin(), asked.end(), suite.name) == asked.end()) return;
  for (const Case& c : suite.cases(options)) {
    const std::string full = fmt::format("{}/{}", suite.name, c.name);
    if (full.find(options.filter) == std::string::npos) continue;
    if (options.on_case) options.on_case(full);
    report.results.push_back(run_case(ctx, suite.name, c, options));
  }
}

std::vector<std::string> names_of(const std::vector<Suite>& suites) {
  std::vector<std::string> names;
  names.reserve(suites.size());
  for (const Suite& s : suites) names.emplace_back(s.name);
  return names;
}

}  // namespace

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
  }
  return "?";
}

std::vector<std::string> suite_names() {
  std::vector<std::string> names = names_of(kSuites);
  for (const std::string& name : operation_names()) names.push_back(name);
  return names;
}

std::vector<std::string> operation_names() { return names_of(kOperations); }

Report run(Context& ctx, const Options& options) {
  const std::vector<std::string> known = suite_names();
  for (const std::string& name : options.suites)
    if (std::find(known.begin(), known.end(), name) == known.end())
      fail(Status::usage, "no suite \"{}\" to bench; there is: {}", name, fmt::join(known, ", "));
  Report report;
  report.tuning = ctx.tuning().hash();
  report.device = ctx.device().name, report.driver = ctx.device().driver, report.kernels = name_of(ctx.flavour());
  // Measured before and after, since other load on the machine may take from either.
  report.peak_gflops = measure_gflops(ctx);
  report.peak_gbs = measure_gbs(ctx);
  for (const auto* suites : {&kSuites, &kOperations})
    for (const Suite& suite : *suites) run_suite(ctx, suite, options, report);
  report.peak_gflops = std::max(report.peak_gflops, measure_gflops(ctx));
  report.peak_gbs = std::max(report.peak_gbs, measure_gbs(ctx));
  for (Result& r : report.results) {
    const double of_memory = r.gbs / report.peak_gbs, of_compute = r.performed_gflops / report.peak_gflops;
    if (r.kind == Kind::operation) r.kind = of_memory > of_compute ? Kind::memory : Kind::compute;
    r.share_of_peak = is_pass(r.kind)          ? std::max(of_memory, of_compute)
                      : r.kind == Kind::memory ? of_memory
                                               : of_compute;
  }
  return report;
}

void record(Context& ctx) { ctx.profiler().enable(true); }

Recorded recorded(Context& ctx) {
  ctx.finish();
  ctx.profiler().enable(false);
  const Profile profile = ctx.profiler().profile();
  const DeviceInfo& device = ctx.device();
  const ProfileSubject subject{device.name,   device.driver,      ctx.memory().peak(), {{"command", "bench"}},
                               peaks_of(ctx), ctx.tuning().hash()};
  return {profile_json(profile, subject), profile_page(profile, subject), profile_trace(profile)};
}

std::string table(const Report& report) {
  std::string out = fmt::format("{} ({}), {} kernels: {:.1f} GFLOP/s, {:.1f} GB/s at the most (measured)\n",
                                report.device, report.driver, report.kernels, report.peak_gflops, report.peak_gbs);
  out += fmt::format("{:<28}{:>12}{:>9}{:>11}{:>9}{:>9}  {:<9}\n", "case", "median", "spread", "GFLOP/s", "GB/s",
                     "share", "of");
  for (const Result& r : report.results) {
    out += fmt::format("{:<28}{:>9.3f} ms{:>8.1f}%{:>11.1f}{:>9.1f}{:>8.1f}%  {:<9}", r.suite + "/" + r.name,
                       r.median_s * 1e3, r.spread * 100, r.gflops, r.gbs, r.share_of_peak * 100, name_of(r.kind));
    for (const auto& [stage, share] : r.stages) out += fmt::format("{} {:.1f}%  ", stage, share * 100);
    for (const auto& [library, seconds] : r.reference)
      out += fmt::format("{} {:.3f} ms ({:.2f}x)", library, seconds * 1e3, seconds / r.median_s);
    out += "\n";
    for (std::size_t i = 0; i < std::min<std::size_t>(r.kernels.size(), 40); ++i) {
      const KernelTime& k = r.kernels[i];
      out += fmt::format("  {:<12}{:<32}{:>6.0f} x{:>10.3f} ms{:>10.1f} GFLOP/s{:>8.1f} GB/s\n", k.stage, k.name,
                         k.calls, k.seconds * 1e3, k.gflops, k.gbs);
    }
  }
  return out;
}

std::string json(const Report& report) {
  nlohmann::ordered_json j;
  j["device"] = report.device;
  j["driver"] = report.driver;
  j["kernels"] = report.kernels;
  j["tuning"] = report.tuning.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(report.tuning);
  j["precision"] = "fp32";
  j["peak_gflops"] = report.peak_gflops;
  j["peak_gbs"] = report.peak_gbs;
  j["results"] = nlohmann::ordered_json::array();
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
                                    {"reference", r.reference}};
    if (!r.stages.empty()) entry["stages"] = r.stages;
    for (const KernelTime& k : r.kernels)
      entry["kernels"].push_back({{"stage", k.stage},
                                  {"name", k.name},
                                  {"calls", k.calls},
                                  {"seconds", k.seconds},
                                  {"gflops", k.gflops},
                                  {"gbs", k.gbs}});
    j["results"].push_back(std::move(entry));
  }
  return j.dump(2) + "\n";
}

}  // namespace vsplat::bench

#include "runtime/profile/peaks.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "runtime/clock.h"
#include "runtime/fail.h"
#include "runtime/files/disk_cache.h"
#include "runtime/log.h"
#include "runtime/profile/profiler.h"
#include "runtime/tuning/stored_finding.h"

namespace vsplat {
namespace {

constexpr double kEnough = 2e-3;  // seconds of a launch; a shorter one more likely has the device to itself
constexpr double kSlow = 0.1;     // a launch that takes so many seconds is not made longer

// The time of the shortest of at least three launches, in seconds, by the profiler's clock.
double least_seconds(Context& ctx, const std::function<void()>& run, double budget) {
  const std::uint64_t begun = now_ns();
  const auto spent = [&] { return static_cast<double>(now_ns() - begun) * 1e-9; };
  ctx.profiler().reset();
  ctx.profiler().enable(true);
  for (int i = 0; i < 3 || (spent() < budget && i < 1000); ++i) {
    run();
    ctx.finish();
  }
  ctx.profiler().enable(false);
  std::uint64_t least = UINT64_MAX;
  for (const ProfileLaunch& launch : ctx.profiler().profile().launches)
    least = std::min(least, launch.end - launch.start);
  return static_cast<double>(std::max<std::uint64_t>(least, 1)) * 1e-9;
}

// Three tensors of n vectors of ones; unset if memory is too small.
std::optional<std::array<Tensor, 3>> streams_of(Context& ctx, long n, int width) {
  try {
    const std::vector<float> ones(static_cast<std::size_t>(n * width), 1.0f);
    return std::array<Tensor, 3>{ctx.upload({n, width}, ones), ctx.upload({n, width}, ones), ctx.tensor({n, width})};
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    return std::nullopt;
  }
}

// The time on the device of a launch that does next to nothing.
double measure_launch_us(Context& of) {
  const auto ctx = of.stream();
  const Tensor out = ctx->tensor({1, 4});
  const KernelId kernel{"peak", "peak_fma", "-DWIDTH=4 -DCHAINS=8"};
  const auto run = [&] { ctx->launch(kernel, items(1, 1), {}, 0L, 0.9f, written(out)); };
  run();
  ctx->finish();
  ctx->profiler().enable(true);
  for (int i = 0; i < 100; ++i) run();
  ctx->finish();
  ctx->profiler().enable(false);
  std::vector<std::uint64_t> took;
  for (const ProfileLaunch& launch : ctx->profiler().profile().launches) took.push_back(launch.end - launch.start);
  const auto middle = took.begin() + static_cast<std::ptrdiff_t>(took.size() / 2);
  std::nth_element(took.begin(), middle, took.end());
  return static_cast<double>(*middle) * 1e-3;
}

std::string key_of(const Context& ctx) {
  const DeviceInfo& d = ctx.device();
  return DiskCache::key({"peaks 1", d.name, d.driver, d.version, d.platform_name, d.platform_version,
                         std::to_string(d.compute_units), name_of(ctx.flavour())});
}

}  // namespace

// On the cpu flavour one work-item's vectors are one register tile; a GPU wants many work-items instead.
double measure_gflops(Context& of, double seconds) {
  const auto stream = of.stream();
  Context& ctx = *stream;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const int width = cpu ? 16 : 4, chains = cpu ? 24 : 8, most = cpu ? 100000 : 2000;
  const long work_items = static_cast<long>(ctx.device().compute_units) * (cpu ? 8 : 4096);
  const Tensor out = ctx.tensor({work_items, width});
  const KernelId kernel{"peak", "peak_fma", fmt::format("-DWIDTH={} -DCHAINS={}", width, chains)};
  int steps = 8;
  // (The cost is left out, so that the launch stays in one part: a single launch is measured.)
  const auto run = [&] { ctx.launch(kernel, items(work_items, cpu ? 1 : 64), {}, steps, 0.9f, written(out)); };
  while (steps < most && least_seconds(ctx, run, 0) < kEnough) steps = std::min(2 * steps, most);
  const double flops = 2.0 * width * chains * steps * static_cast<double>(work_items);
  return flops / least_seconds(ctx, run, seconds) / 1e9;
}

double measure_gbs(Context& of, double seconds) {
  const auto stream = of.stream();
  Context& ctx = *stream;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const int width = cpu ? 16 : 4;
  const KernelId kernel{"peak", "peak_stream", fmt::format("-DWIDTH={}", width)};
  double best = 0;
  for (long numbers = 1 << 18, most = (cpu ? 16L : 64L) << 20; numbers <= most; numbers *= 4) {
    const long n = numbers / width;
    const auto streams = streams_of(ctx, n, width);
    if (!streams) break;
    const Tensor &a = (*streams)[0], &b = (*streams)[1], &y = (*streams)[2];
    const double bytes = 3.0 * static_cast<double>(a.bytes());
    const long group = cpu ? std::min(256L, static_cast<long>(ctx.device().max_work_group)) : 64;
    const auto run = [&] { ctx.launch(kernel, items(n, group), {}, n, 0.5f, a, b, written(y)); };
    const double once = least_seconds(ctx, run, 0);
    const bool last = numbers * 4 > most || once > kSlow;
    best = bytes / (last ? std::min(once, least_seconds(ctx, run, seconds)) : once) / 1e9;  // the last: largest
    if (last) break;
  }
  return best;
}

std::optional<Peaks> known_peaks(const Context& ctx) {
  const auto kept = DiskCache().load(key_of(ctx));
  if (!kept) return std::nullopt;
  const auto json = nlohmann::json::parse(kept->begin(), kept->end(), nullptr, false);
  try {
    const Peaks out{json.at("gflops"), json.at("gbs"), json.at("launch_us"), json.at("measured")};
    if (out.gflops > 0 && out.gbs > 0 && out.launch_us >= 0) return out;
  } catch (const nlohmann::json::exception&) {  // written by another version
  }
  return std::nullopt;
}

double gflops_seen(const Profile& profile) {
  double out = 0;
  for (const ProfileRow& row : profile.rows)
    if (row.total_ns >= 1'000'000) out = std::max(out, row.performed_flops / static_cast<double>(row.total_ns));
  return out;
}

Peaks peaks_of(Context& ctx, double gflops_seen) {
  const auto known = known_peaks(ctx);
  if (known && gflops_seen <= 1.02 * known->gflops) return *known;
  info("measuring the peak rates of {} once, for profiles", ctx.device().name);
  const bool recording = ctx.profiler().enabled();
  ctx.finish();
  ctx.profiler().enable(false);
  const std::uint64_t begun = now_ns();
  Peaks out;
  try {
    out = {measure_gflops(ctx), measure_gbs(ctx), measure_launch_us(ctx), today()};
  } catch (const Error&) {
    ctx.profiler().enable(recording);
    throw;
  }
  if (known) out.gflops = std::max(out.gflops, known->gflops), out.gbs = std::max(out.gbs, known->gbs);
  out.gflops = std::max(out.gflops, gflops_seen);  // a speed that a kernel has reached is possible
  const std::string text = nlohmann::json{{"device", ctx.device().name}, {"driver", ctx.device().driver},
                                          {"gflops", out.gflops},        {"gbs", out.gbs},
                                          {"launch_us", out.launch_us},  {"measured", out.measured}}
                               .dump(1, ' ', false, nlohmann::json::error_handler_t::replace);
  DiskCache().store(key_of(ctx), std::vector<unsigned char>(text.begin(), text.end()));
  out.measuring_s = static_cast<double>(now_ns() - begun) * 1e-9;
  ctx.profiler().enable(recording);
  return out;
}

}  // namespace vsplat

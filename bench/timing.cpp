#include "bench/timing.h"

#include <algorithm>
#include <chrono>

#include "model/base/statistics.h"

namespace vsplat::bench {
namespace {

constexpr int kRounds = 3, kMostRounds = 1000;
constexpr double kLongest = 30;  // times the seconds asked for, where a run takes long

// Inputs differ in what they take; what spreads is one input's time.
Times times_of(const std::vector<std::vector<double>>& by_input) {
  std::vector<double> all, relative;
  double mean = 0;
  for (const auto& times : by_input) {
    all.insert(all.end(), times.begin(), times.end());
    mean += quantile(times, 0.5) / static_cast<double>(by_input.size());
    for (const double t : times) relative.push_back(t / quantile(times, 0.5));
  }
  return {quantile(all, 0.5), quantile(relative, 0.75) - quantile(relative, 0.25), quantile(all, 0), mean};
}

}  // namespace

double seconds_of(Context& ctx, const std::function<void()>& run) {
  const auto start = std::chrono::steady_clock::now();
  run();
  ctx.finish();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<Times> time_by_turns(Context& ctx, const std::vector<Timed>& all, const TimingOptions& options, bool warm) {
  for (const Timed& timed : all)
    for (int i = warm ? 1 : 0; i < timed.inputs; ++i) timed.run();
  ctx.finish();
  std::vector<std::vector<std::vector<double>>> taken;  // of each, by input
  taken.reserve(all.size());
  for (const Timed& timed : all) taken.emplace_back(static_cast<std::size_t>(timed.inputs));
  const double share = options.seconds * static_cast<double>(all.size());
  double spent = 0;
  const auto another = [&](int round) {
    if (round == 0) return true;
    if (options.seconds <= 0 || round >= kMostRounds) return false;
    return spent < share || (round < kRounds && spent < kLongest * share);
  };
  const auto left = [&](int round) {
    if (round == 0) return -1.0;
    const double each = spent / round;
    return each * std::max({1.0, kRounds - static_cast<double>(round), (share - spent) / each});
  };
  for (int round = 0; another(round); ++round) {
    if (options.before_round) options.before_round(round + 1, left(round));
    for (std::size_t which = 0; which < all.size(); ++which)
      for (auto& times : taken[which]) {
        times.push_back(seconds_of(ctx, all[which].run));
        spent += times.back();
      }
  }
  std::vector<Times> out;
  out.reserve(taken.size());
  for (const auto& by_input : taken) out.push_back(times_of(by_input));
  return out;
}

}  // namespace vsplat::bench

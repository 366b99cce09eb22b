#include "model/train/schedule.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Position of `step` between `first` and `last`, clamped to 0 to 1.
double progress(long step, long first, long last) {
  if (step >= last) return 1;
  return step <= first ? 0 : static_cast<double>(step - first) / static_cast<double>(last - first);
}

void check(long step) {
  if (step < 1) fail(Status::internal, "schedule: step {}, steps count from 1", step);
}

}  // namespace

long usual_warmup(long steps) { return std::clamp(steps / 50, 1L, 1000L); }

long usual_fine_after(long steps) { return std::clamp(steps / 10, 1L, 5000L); }

long total_steps(const Schedule& s) { return std::accumulate(s.extend.begin(), s.extend.end(), s.steps); }

double learning_rate(const Schedule& s, long step) {
  check(step);
  long steps = s.steps, warmup = s.warmup;
  for (const long more : s.extend) {
    if (step <= steps) break;
    step -= steps;
    steps = more;
    warmup = usual_warmup(more);
  }
  if (step <= warmup) return s.lr * static_cast<double>(step) / static_cast<double>(warmup);
  return s.lr * (1 + std::cos(kPi * progress(step, warmup, steps))) / 2;
}

double temperature(const Schedule& s, long step) {
  check(step);
  return std::lerp(s.tau_first, s.tau_last, progress(step, 1, 1 + s.tau_steps));
}

std::vector<std::string> unfinished(const Schedule& s) {
  std::vector<std::string> out;
  const long all = total_steps(s);
  if (2 * s.warmup > s.steps && s.warmup > usual_warmup(s.steps))
    out.push_back(fmt::format(
        "the learning rate rises for {} of {} steps and has little time to fall: \"warmup\" is {}, {} is usual",
        s.warmup, s.steps, s.warmup, usual_warmup(s.steps)));
  // The paper's temperature schedule ends one step early.
  if (s.tau_steps > all && s.tau_first != s.tau_last)
    out.push_back(fmt::format(
        "the temperature ends at {:.2f} and not at \"tau_last\", {:g}: \"tau_steps\" is {}, of {} steps in all",
        temperature(s, all), s.tau_last, s.tau_steps, all));
  return out;
}

bool extended_alike(const Schedule& a, const Schedule& b, long step) {
  long begin = a.steps;
  for (std::size_t i = 0; step > begin && i < std::max(a.extend.size(), b.extend.size()); ++i) {
    if (i >= a.extend.size() || i >= b.extend.size() || a.extend[i] != b.extend[i]) return false;
    begin += a.extend[i];
  }
  return true;
}

}  // namespace vsplat

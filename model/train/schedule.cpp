#include "model/train/schedule.h"

#include <cmath>

#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr double kPi = 3.14159265358979323846;

// How far the step is from `first` to `last`, 0 to 1.
double progress(long step, long first, long last) {
  if (step >= last) return 1;
  return step <= first ? 0 : static_cast<double>(step - first) / static_cast<double>(last - first);
}

void check(long step) {
  if (step < 1) fail(Status::internal, "schedule: step {}, steps count from 1", step);
}

}  // namespace

double learning_rate(const Schedule& s, long step) {
  check(step);
  if (step <= s.warmup) return s.lr * static_cast<double>(step) / static_cast<double>(s.warmup);
  return s.lr * (1 + std::cos(kPi * progress(step, s.warmup, s.steps))) / 2;
}

double temperature(const Schedule& s, long step) {
  check(step);
  return std::lerp(s.tau_first, s.tau_last, progress(step, 1, 1 + s.tau_steps));
}

}  // namespace vsplat

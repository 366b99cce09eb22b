// Measures the duration of a step, to estimate the remaining time.
#pragma once
#include <optional>

namespace vsplat {

// The mean duration of the last hundred or so steps without compilation. A step counts only if the previous one
// compiled nothing either, because work enqueued there may run, and cause compilation, during the next step.
class StepPace {
 public:
  // `compilations`: Profiler::compilations() at the end of the step.
  void add(double seconds, long compilations) {
    const bool warm = compilations == last_ && last_ == before_;
    before_ = last_;
    last_ = compilations;
    if (!warm) return;
    seconds_ = kFall * seconds_ + seconds;
    steps_ = kFall * steps_ + 1;
  }
  // Nothing before the first such step.
  std::optional<double> seconds() const {
    if (steps_ == 0) return std::nullopt;
    return seconds_ / steps_;
  }

 private:
  static constexpr double kFall = 0.99;  // weight of each step after the next one
  long last_ = -1, before_ = -1;
  double seconds_ = 0, steps_ = 0;
};

}  // namespace vsplat

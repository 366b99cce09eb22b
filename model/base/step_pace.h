// Measures the duration of a step, to estimate the remaining time.
#pragma once
#include <optional>

namespace vsplat {

// The mean duration of steps without compilation. A step counts only if the previous one compiled nothing either,
// because work enqueued there may run, and cause compilation, during the next step.
class StepPace {
 public:
  // `compilations`: Profiler::compilations() at the end of the step.
  void add(double seconds, long compilations) {
    const bool warm = compilations == last_ && last_ == before_;
    before_ = last_;
    last_ = compilations;
    if (!warm) return;
    seconds_ += seconds;
    ++steps_;
  }
  // Nothing before the first such step.
  std::optional<double> seconds() const {
    if (steps_ == 0) return std::nullopt;
    return seconds_ / static_cast<double>(steps_);
  }

 private:
  long last_ = -1, before_ = -1, steps_ = 0;
  double seconds_ = 0;
};

}  // namespace vsplat

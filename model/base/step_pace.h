// How long a step takes, for whoever tells how long the rest will take.
#pragma once
#include <optional>

namespace vsplat {

// The mean of the steps in which nothing was compiled. A step is counted where the one before compiled nothing either:
// what that has enqueued may run, and be compiled for, during the next.
class StepPace {
 public:
  // `compilations`: Profiler::compilations() at the step's end.
  void add(double seconds, long compilations) {
    const bool warm = compilations == last_ && last_ == before_;
    before_ = last_;
    last_ = compilations;
    if (!warm) return;
    seconds_ += seconds;
    ++steps_;
  }
  // None before the first such step.
  std::optional<double> seconds() const {
    if (steps_ == 0) return std::nullopt;
    return seconds_ / static_cast<double>(steps_);
  }

 private:
  long last_ = -1, before_ = -1, steps_ = 0;
  double seconds_ = 0;
};

}  // namespace vsplat

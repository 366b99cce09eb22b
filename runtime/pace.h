// Keeps little work ahead of a device: what is told to stop (Context::cancel) ends when that is done, and no sooner.
#pragma once
#include <chrono>
#include <optional>

#include "runtime/launch.h"
#include "runtime/opencl.h"

namespace vsplat {

class Pace {
 public:
  // After a launch of that cost was enqueued. Waits where more is ahead of the device than it does in some 40 ms.
  void add(const cl::CommandQueue& queue, Cost cost);

 private:
  using Clock = std::chrono::steady_clock;

  void mark(const cl::CommandQueue& queue);

  double ahead_ = 0;   // seconds that what was enqueued since the last mark is thought to take
  double factor_ = 1;  // of this device to the one that costs are first taken for, learnt
  std::optional<cl::Event> mark_;
  Clock::time_point waited_;  // for the mark before that
};

}  // namespace vsplat

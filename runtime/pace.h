// Limits the work that is queued on a device: a cancelled run (Context::cancel) ends only when its queued work is done.
#pragma once
#include <chrono>
#include <optional>

#include "runtime/launch.h"
#include "runtime/opencl.h"

namespace vsplat {

class Pace {
 public:
  // Call after a launch of that cost was enqueued. Waits if the device has more than some 40 ms of work queued.
  void add(const cl::CommandQueue& queue, Cost cost);

 private:
  using Clock = std::chrono::steady_clock;

  void mark(const cl::CommandQueue& queue);

  double ahead_ = 0;   // estimated seconds of the work enqueued since the last mark
  double factor_ = 1;  // learnt ratio of measured to estimated time
  std::optional<cl::Event> mark_;
  Clock::time_point waited_;  // when the wait for the previous mark ended
};

}  // namespace vsplat

#include "runtime/pace.h"

#include <algorithm>

namespace vsplat {
namespace {

constexpr double kPart = 0.02;                                         // seconds from one mark to the next
constexpr double kFlops = 1e11, kBytes = 1e10, kLaunchSeconds = 2e-5;  // initial estimate: a mid-range CPU

}  // namespace

void Pace::add(const cl::CommandQueue& queue, Cost cost) {
  // Kernels that find out themselves how much there is to do perform about an eighth of their maximum.
  const double flops = std::max(cost.performed > 0 ? cost.performed : cost.flops, cost.most / 8);
  ahead_ += factor_ * (std::max(flops / kFlops, cost.bytes / kBytes) + kLaunchSeconds);
  if (ahead_ >= kPart) mark(queue);
}

// Waits for the previous mark: while the host waits, the device still has the work since then to do.
void Pace::mark(const cl::CommandQueue& queue) {
  const double thought = ahead_;
  ahead_ = 0;
  cl::Event next;
  queue.enqueueMarkerWithWaitList(nullptr, &next);
  queue.flush();
  if (mark_) {
    // If the device has reached it already, the device is faster than estimated, but by an unknown factor.
    double faster = 0.5;
    if (mark_->getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>() != CL_COMPLETE) {
      mark_->wait();
      faster = std::clamp(std::chrono::duration<double>(Clock::now() - waited_).count() / thought, 0.25, 4.0);
    }
    factor_ = std::clamp(factor_ * (0.5 + 0.5 * faster), 1e-4, 1e3);
  }
  waited_ = Clock::now();
  mark_ = next;
}

}  // namespace vsplat

#include "runtime/pace.h"

#include <algorithm>

namespace vsplat {
namespace {

constexpr double kPart = 0.02;                                         // seconds from one mark to the next
constexpr double kFlops = 1e11, kBytes = 1e10, kLaunchSeconds = 2e-5;  // a middling CPU's, to begin with

}  // namespace

void Pace::add(const cl::CommandQueue& queue, Cost cost) {
  // (Of what finds out itself how much it does, that is some eighth of the most.)
  const double flops = std::max(cost.performed > 0 ? cost.performed : cost.flops, cost.most / 8);
  ahead_ += factor_ * (std::max(flops / kFlops, cost.bytes / kBytes) + kLaunchSeconds);
  if (ahead_ >= kPart) mark(queue);
}

// Waits for the mark before the one that it sets: while the host is held, a part is left for the device to do.
void Pace::mark(const cl::CommandQueue& queue) {
  const double thought = ahead_;
  ahead_ = 0;
  cl::Event next;
  queue.enqueueMarkerWithWaitList(nullptr, &next);
  queue.flush();
  if (mark_) {
    // Where it is reached already, the device is quicker than thought, by how much is not known.
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

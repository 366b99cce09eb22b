// Progress of a network's run, and the memory check before it starts.
#pragma once
#include <functional>
#include <string>

#include "runtime/context.h"

namespace vsplat {

// Reports the stage that begins and the share of the work that is done. If there is a listener, it waits for the queue
// first, so that the report is accurate.
class Progress {
 public:
  using Listener = std::function<void(const std::string& stage, double done)>;  // may throw to cancel

  // `total`: the sum of the work passed to begin() and skip().
  Progress(Context& ctx, const Listener& listener, double total) : ctx_(ctx), listener_(listener), total_(total) {}
  void begin(const char* stage, double work) {
    if (!listener_ || ctx_.planning()) return;
    ctx_.finish();
    listener_(stage, done_ / total_);
    done_ += work;
  }
  void skip(double work) { done_ += work; }

 private:
  Context& ctx_;
  const Listener& listener_;
  double total_, done_ = 0;
};

// Error(memory) with both figures if `plan` needs more than the device has.
void refuse_unless_fits(const Context& plan, const std::string& what);

// Calls make(ctx) after planning its memory, so that its slabs are allocated at once with their exact size.
// Error(memory) as above.
template <class Make>
auto made_to_measure(Context& ctx, const std::string& what, const Make& make) {
  if (!ctx.planning()) {
    const auto planner = ctx.planner();
    [[maybe_unused]] const auto counted = make(*planner);
    refuse_unless_fits(*planner, what);
    ctx.memory().commit(planner->memory());
  }
  return make(ctx);
}

}  // namespace vsplat

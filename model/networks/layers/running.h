// What a network's run tells while it goes on, and what it refuses before it begins.
#pragma once
#include <functional>
#include <string>

#include "runtime/context.h"

namespace vsplat {

// Names the stage that begins and the share of the work behind it. The queue is drained first, where somebody listens,
// so that what is told is true.
class Progress {
 public:
  using Listener = std::function<void(const std::string& stage, double done)>;  // may throw to cancel

  // `total`: of the work that begin() and skip() are given.
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

// Error(memory) with both figures, where what `plan` came to need is more than the device has.
void refuse_unless_fits(const Context& plan, const std::string& what);

// make(ctx), whose memory is planned before: its slabs are made at once, and to measure. Error(memory) as above.
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

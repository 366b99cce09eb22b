// What a stage's backward needs from its forward. It is either stored by the forward or, to save memory, recomputed on
// demand by running the forward again. Both ways give the same bits.
#pragma once
#include <functional>
#include <utility>

#include "runtime/context.h"

namespace vsplat {

template <class State>
class Checkpointed {
 public:
  using Forward = std::function<void(Context&, State&)>;

  explicit Checkpointed(bool recompute) : recompute_(recompute) {}

  // Where the forward stores it; null if the forward will run again.
  State* place() { return recompute_ ? nullptr : &state_; }

  // Sets the forward to run again. The function holds the stage's inputs until it has run.
  void made_by(Forward forward) { forward_ = std::move(forward); }

  // Call once: the memory is freed with the caller's copy.
  State take(Context& ctx) {
    if (const Forward forward = std::exchange(forward_, nullptr)) forward(ctx, state_);
    return std::exchange(state_, {});
  }

 private:
  bool recompute_;
  State state_;
  Forward forward_;
};

}  // namespace vsplat

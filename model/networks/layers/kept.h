// What a stage's backward wants of its forward: kept from the forward, or, in less memory, made when it is asked for by
// running the forward once more. The same bits either way.
#pragma once
#include <functional>
#include <utility>

#include "runtime/context.h"

namespace vsplat {

template <class State>
class Kept {
 public:
  using Forward = std::function<void(Context&, State&)>;

  explicit Kept(bool recompute) : recompute_(recompute) {}

  // Where the forward is to write it; null where the forward will run once more.
  State* place() { return recompute_ ? nullptr : &state_; }

  // The stage's forward with its inputs, which are held until it has run.
  void made_by(Forward forward) { forward_ = std::move(forward); }

  // Once: the memory goes back with the caller's copy.
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

// An operation at one shape, on random numbers, ready to be run with any set of its parameters, and held against sums
// in double on the host, on a sample of what it computes.
#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "runtime/context.h"

namespace vsplat {

class TuneCase {
 public:
  virtual ~TuneCase() = default;
  // What comes before runs with what the context is tuned to now: weights, in the layout that it wants. The run, then,
  // which may be repeated, and is enqueued.
  virtual std::function<void()> ready(Context& ctx) = 0;
  // What a run writes.
  virtual std::vector<Tensor> outputs() const = 0;
  // Overwrites that with what is no number: what another run has left there is no result.
  virtual void spoil(Context& ctx);
  // Of what the last run wrote, the worst error of a sample, by the sample's largest value; infinite where something is
  // no number.
  virtual double error(Context& ctx) = 0;
  virtual double tolerance() const { return 1e-4; }
  double flops = 0;  // of a run, or what is like them
};

// Its data on the context's device. Error(memory) where there is no room.
std::unique_ptr<TuneCase> tune_case(Context& ctx, const TunedShape& shape);
// A shape with the same operation whose every size is small, odd, and no multiple of any tile's.
TunedShape odd_shape(const TunedShape& like);

}  // namespace vsplat

// An operation at one shape, on random numbers, ready to run with any set of its parameters. A sample of its results is
// checked against sums in double on the host.
#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "runtime/context.h"

namespace vsplat {

class TuneCase {
 public:
  virtual ~TuneCase() = default;
  // Prepares weights in the layout of the context's current tuning. The returned function enqueues a run, and may be
  // called repeatedly.
  virtual std::function<void()> ready(Context& ctx) = 0;
  // The outputs of a run.
  virtual std::vector<Tensor> outputs() const = 0;
  // Overwrites the outputs with NaN, so that results of an earlier run do not count.
  virtual void spoil(Context& ctx);
  // Largest error of a sample of the last run's outputs, relative to the sample's largest value; infinite if a value is
  // not finite.
  virtual double error(Context& ctx) = 0;
  virtual double tolerance() const { return 1e-4; }
  double flops = 0;  // of a run, or a comparable measure
};

// Allocates its data on the context's device. Error(memory) if they do not fit.
std::unique_ptr<TuneCase> tune_case(Context& ctx, const TunedShape& shape);
// A shape of the same operation whose sizes are all small, odd, and no multiple of a tile.
TunedShape odd_shape(const TunedShape& like);

}  // namespace vsplat

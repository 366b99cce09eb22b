// The optimiser of a training, on the device: clipping, AdamW or Muon with their state, and the weights' average.
#pragma once
#include <vector>

#include "model/networks/layers/learnt_weights.h"
#include "model/train/checkpoint.h"
#include "runtime/side_by_side.h"

namespace vsplat {

class WeightOptimiser {
 public:
  enum Kind { none, adamw, adamw_decaying, muon };  // of a run of parameters; none: they are frozen
  static Kind kind_of(const TrainConfig& config, const Parameter& parameter);

  // `weights`: their runs have these kinds. `start`: where the state continues; null: no state, since the optimiser of
  // another trainer moves these.
  WeightOptimiser(Context& ctx, const TrainConfig& config, const LearntWeights& weights, const Checkpoint* start);

  // The norm of the present gradients and the factor that clips them, as gradient_clip() writes them.
  Tensor clipped_norm(Context& ctx) const;
  // One step with the present gradients, clipped by `norm`; the average follows. Each call takes the context of the
  // weights, or a planner made from it.
  void step(Context& ctx, long number, double lr, const Tensor& norm) const;
  void move(Context& ctx, long number, double lr, const Tensor& norm) const;  // without the average
  // Error(internal) that names the first gradient that is not finite, in step `number`.
  [[noreturn]] void refuse(long number, double loss) const;
  // Reads the state back from the device, and the moments unless no step was done.
  void download(long steps_done, Checkpoint& out) const;

 private:
  // The state of a run of weights, contiguous like the run. Frozen parameters have none.
  struct Moments {
    SideBySide m, v;  // `v` is empty for Muon, which only has momentum
  };
  SideBySide like(const LearntRun& run, const char* what, const Weights& values) const;

  Context& ctx_;
  const TrainConfig& config_;
  const LearntWeights& weights_;
  std::vector<Moments> moments_;     // one per run
  std::vector<SideBySide> average_;  // one per run, if there is an average
};

}  // namespace vsplat

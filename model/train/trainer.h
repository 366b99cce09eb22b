// The trainer: weights and optimiser state on the device, and a training step.
#pragma once
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "model/networks/layers/learnt_weights.h"
#include "model/train/checkpoint.h"
#include "model/train/train_step.h"
#include "model/train/training_pass.h"
#include "model/train/weight_optimiser.h"
#include "runtime/system/ranks.h"

namespace vsplat {

class Trainer {
 public:
  // Continues from `start`, which has no moments at step 0. Uploads it. `ctx` may be a planner, for plan().
  // `planned_selected`: voxels to allocate for before the first selection is known. `helpers`: other devices that
  // compute shards of a step's gradients; the optimiser runs only on `ctx`. `ranks`: other processes that do so, each
  // with a trainer made from the same start; only rank 0 has the optimiser.
  Trainer(Context& ctx, const Checkpoint& start, long planned_selected = 0, const std::vector<Context*>& helpers = {},
          Ranks* ranks = nullptr);

  const TrainConfig& config() const { return config_; }
  long step() const { return step_; }  // steps done
  const LearntWeights& weights() const { return weights_; }

  // One step of the optimiser on batch * accumulate objects. Waits for the device. On a loss or gradient that is not
  // finite, throws Error(internal) with the step and the first such tensor; if memory runs out, Error(memory) with both
  // figures. Either way weights and state are unchanged.
  // An object's memory is planned and allocated before its computation, for the number of selected voxels seen so far.
  // If more are selected, the object starts again. If it does not fit, activations are recomputed instead of stored,
  // and then pictures are rendered in tiles as needed. This depends on the object, the weights and the limit, not on
  // earlier steps.
  // Helpers take shards as fast as they compute them. If they differ in kind from `ctx` (device, driver, flavour of
  // kernels), each kind keeps the shards that it took in the first step; the checkpoint stores the kind of each shard's
  // device. A helper whose device fails gets no more shards: a warning is logged and the others continue.
  // With several ranks, only rank 0 calls this; the others call help(). Each rank needs only the items of its own
  // shards.
  StepReport step(const std::vector<StepItem>& items);

  // Computes this rank's shards of the step for rank 0. An error is sent to rank 0, where it ends the step.
  void help(const std::vector<StepItem>& items);
  // Takes rank 0's updated weights, and the kinds of the shards' devices.
  void take_moved(std::vector<float> values, const std::string& kinds);
  // The arguments of take_moved(), on rank 0. `kinds` is empty if all devices are of one kind.
  const std::vector<float>& moved() const { return moved_; }
  std::string kinds() const;

  // The objects of a step whose gradients this rank computes: [first, last).
  std::pair<std::size_t, std::size_t> own_objects() const;

  // Reads everything back from the device.
  Checkpoint checkpoint() const;

  // Bytes on the device. `intersections` of Gaussians and tiles in each picture; default: eight for each Gaussian.
  struct Plan {
    bool fits = true;
    std::size_t peak = 0;  // total, weights included; if it does not fit, the minimum that it needs
    std::vector<StageMemory> stages;
    std::string problem;  // if it does not fit: the allocation that failed, if there was a single one
  };
  Plan plan(long selected, std::optional<std::uint64_t> intersections) const;
  // For the planned number of voxels.
  Plan plan(std::optional<std::uint64_t> intersections) const;
  // With all voxels selected and every Gaussian in every tile: an upper bound for any step.
  Plan bound() const;
  // The optimiser's launches, on a planning context: plan() covers only the gradients.
  void plan_optimizer() const { optimiser_.step(ctx_, 1, 0, optimiser_.clipped_norm(ctx_)); }

 private:
  // The memory allocated for an object.
  struct ObjectMemory {
    long selected = 0;       // capacity, in voxels
    bool recompute = false;  // as in PassOptions
    long views = 0;          // capacity, in views; 0: not allocated yet
    // Whether the next object reuses it. True only if memory is ample, so that what fits does not depend on earlier
    // allocations.
    bool kept_between = false;
  };
  // Whether this trainer updates weights, or computes gradients for another one.
  enum class Role { optimiser, helper };
  Trainer(Context& ctx, const Checkpoint& start, long planned_selected, Role role);
  static Context& with_slabs(Context& ctx, const Checkpoint& start, Role role);
  struct StepObject {
    const StepItem& given;
    std::uint32_t noise_draw = 0;  // index of its noise among the seed's draws
  };
  // Sets the loss terms that are active at a step.
  void set_loss(PassOptions& options, long step) const;
  // Uploads an object, and its noise to `options` if the network uses noise.
  PassViews upload(Context& ctx, const StepObject& object, PassOptions& options) const;
  // Computes the gradients of the objects [first, last) and leaves them with the weights. If memory runs out, tries
  // once more with the smallest memory.
  ShardSums gradients(const std::vector<StepItem>& items, std::size_t first, std::size_t last);
  ShardSums gradients(const std::vector<StepItem>& items, std::size_t first, std::size_t last, bool recompute);
  struct Part {
    ShardSums sums;
    std::vector<float> gradients;
    std::string kind;  // the kind of the device that computed it
  };
  // The shards of a rank: [first, last).
  std::pair<std::size_t, std::size_t> parts_of(int rank) const;
  std::size_t first_object(std::size_t part) const;
  // Computes this rank's shards on all of its devices. Calls `done` in the shards' order, one call at a time, on any
  // thread.
  void compute_parts(const std::vector<StepItem>& items, const std::function<void(Part)>& done);
  // Gradients of all objects from all ranks, summed in the shards' order.
  ShardSums gradients_in_parts(const std::vector<StepItem>& items);
  std::vector<std::size_t> owners(const std::vector<Trainer*>& workers) const;
  void keep_kinds(const std::vector<std::string>& kinds);
  std::string kind() const;  // of its device
  // Values of the parameters that are not frozen, tensor by tensor, in the same order on every device.
  std::vector<float> read_moved(Tensor LearntTensor::*what) const;
  void write_moved(Tensor LearntTensor::*what, const std::vector<float>& values) const;
  // Runs the forward and the rendering in memory allocated for them, and sets `memory` to what it used. `planned`:
  // selected voxels, on a planning context.
  DrawnPass draw_in_memory(Context& ctx, const Network& network, const StepObject& object, PassOptions options,
                           ObjectMemory& memory, long planned) const;
  void make_memory(Context& ctx, const Network& network, const StepObject& object, PassOptions options,
                   ObjectMemory& memory) const;
  long rounded(long selected) const;
  // Whether an object fits; sets `out` to its memory in either case.
  bool plan_object(Plan& out, ObjectMemory memory, long selected, std::optional<std::uint64_t> intersections,
                   bool network_alone) const;

  Context& ctx_;
  TrainConfig config_;
  long planned_;  // in voxels
  ObjectMemory memory_;
  long step_ = 0;
  LearntWeights weights_;
  WeightOptimiser optimiser_;
  std::map<std::string, std::string> state_;
  std::vector<std::unique_ptr<Trainer>> helpers_;
  std::vector<float> moved_;  // updated weights for the helpers
  bool computes_ = true;      // shards; false once its device has failed
  Ranks* ranks_ = nullptr;    // null: this process alone
};

}  // namespace vsplat

// Training: the weights and the optimiser's state on the device, and the step that moves them.
#pragma once
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "model/data/training_views.h"
#include "model/networks/layers/learnt_weights.h"
#include "model/train/checkpoint.h"
#include "model/train/training_pass.h"
#include "runtime/side_by_side.h"
#include "runtime/system/ranks.h"

namespace vsplat {

// An object for a step. `noise`, where it is not null, stands for the seed's: [R^3] logistic noise; `selection` for
// the voxels that would be selected, ascending.
struct StepItem {
  const TrainingViews* views = nullptr;
  std::array<float, 3> input_background{1, 1, 1};  // that input views are drawn over; their pictures lie on it
  const std::vector<float>* noise = nullptr;
  const std::vector<int>* selection = nullptr;
};

// Means over a step's objects.
struct StepReport {
  long step = 0;                     // from 1
  double lr = 0, temperature = 0;    // of this step
  double loss = 0;                   // both levels, and predicted rays
  double psnr = 0, psnr_coarse = 0;  // from the mean squared error over novel views (input views, where there are no
                                     // others); where `levels` is "coarse" they are equal
  double selected = 0;               // share of what the network selects from: voxels, or LaRa's primitives
  double gradient_norm = 0;          // before clipping
  std::uint64_t intersections = 0;   // the most in a picture
  long most_selected = 0;            // of them, of the objects
};

class Trainer {
 public:
  // Goes on from `start`; its step 0 has no moments. Uploads. `ctx` may be a planner, for plan().
  // `planned_selected`: voxels that memory is made for before the first selection is known. `helpers`: other devices,
  // which compute parts of a step's gradients beside `ctx`; the optimiser is on `ctx` alone. `ranks`: other processes
  // that do so, each with a trainer of its own from the same start; the optimiser is rank 0's alone.
  Trainer(Context& ctx, const Checkpoint& start, long planned_selected = 0, const std::vector<Context*>& helpers = {},
          Ranks* ranks = nullptr);

  const TrainConfig& config() const { return config_; }
  long step() const { return step_; }  // steps done
  const LearntWeights& weights() const { return weights_; }

  // One step of the optimiser on batch * accumulate objects. Waits for the device. Where the loss or a gradient is no
  // number, or infinite, the weights and the state stay, and an Error(internal) names the step and the first tensor;
  // so they do where memory does not suffice, and an Error(memory) has both figures.
  // An object's memory is planned and made before it begins, for as many selected voxels as there were before; it
  // begins anew where there are more. Where it does not fit, activations are computed a second time instead of kept,
  // and then, pictures are drawn in parts where they must: that depends on the object, the weights and the limit, not
  // on the steps before.
  // Helpers take the parts that they are fast enough for; where they are of other kinds than `ctx` (device, driver,
  // flavour of kernels), those that they took in the first step, and the checkpoint keeps of which kind each part's
  // device was. One whose device fails gets no more: a warning, and the others go on.
  // Of several ranks rank 0's, while the others help(); each needs the items of its own parts alone.
  StepReport step(const std::vector<StepItem>& items);

  // Its rank's parts of the step, for rank 0. What fails is told there, and ends the step.
  void help(const std::vector<StepItem>& items);
  // The weights that rank 0 has moved, and of which kinds the parts' devices are.
  void take_moved(std::vector<float> values, const std::string& kinds);
  // For take_moved(); by rank 0. No kinds: they are one.
  const std::vector<float>& moved() const { return moved_; }
  std::string kinds() const;

  // The objects of a step whose gradients this rank computes: [first, last).
  std::pair<std::size_t, std::size_t> own_objects() const;

  // Everything, read back.
  Checkpoint checkpoint() const;

  // Bytes on the device. `intersections` of Gaussians with tiles in each picture; none: eight for each Gaussian.
  struct Plan {
    bool fits = true;
    std::size_t peak = 0;  // in all, weights included; where it does not fit, what it takes at the least
    std::vector<StageMemory> stages;
    std::string problem;  // where it does not fit: what asked for more, if it was one thing
  };
  Plan plan(long selected, std::optional<std::uint64_t> intersections) const;
  // The same at the planned number of voxels.
  Plan plan(std::optional<std::uint64_t> intersections) const;
  // With all voxels selected and every Gaussian in every tile: no step takes more.
  Plan bound() const;
  // The optimiser's launches, on a context that plans: plan() goes no further than the gradients.
  void plan_optimizer() const;

 private:
  // How a weight is moved; those that are moved alike lie in one run.
  enum Mover { nobody, adamw, adamw_decaying, muon };
  // What the optimiser has of a run, side by side as the weights are; nothing of what nobody moves.
  struct Moments {
    SideBySide m, v;  // no v: Muon's momentum alone
  };
  // The memory that an object is given.
  struct ObjectMemory {
    long selected = 0;       // voxels that it is made for
    bool recompute = false;  // as PassOptions have it
    long views = 0;          // that it was made for already; 0: it is still to be made
    // Whether it stays for the next object: only where there is more than enough, so that what fits does not depend on
    // what was made before.
    bool kept_between = false;
  };
  // Whether it moves weights, or computes gradients for one that does.
  enum class Role { optimiser, helper };
  Trainer(Context& ctx, const Checkpoint& start, long planned_selected, Role role);
  static Context& with_slabs(Context& ctx, const Checkpoint& start, Role role);
  static Mover mover_of(const TrainConfig& config, const Parameter& parameter);
  SideBySide like(const LearntRun& run, const char* what, const Weights& values) const;
  struct StepObject {
    const StepItem& given;
    std::uint32_t noise_draw = 0;  // which of the draws from the seed its noise is
  };
  // What of the loss that step has.
  void set_loss(PassOptions& options, long step) const;
  // With the noise in `options`, where the network has any.
  PassViews upload(Context& ctx, const StepObject& object, PassOptions& options) const;
  void clip(Context& ctx, const Tensor& out) const;
  // One step of the optimiser by the gradients that are there, clipped by `norm`.
  void move_weights(Context& ctx, const StepReport& report, const Tensor& norm) const;
  // What a part of a step's objects comes to: sums over them, each by its share in the step.
  struct PartSums {
    StepReport report;  // but for its PSNR
    double mse = 0, mse_coarse = 0;
    void add(const PartSums& next);
    StepReport means() const;
  };
  // Of the objects [first, last); the gradients are those of the weights then. Where memory does not suffice, once more
  // as small as it goes.
  PartSums gradients(const std::vector<StepItem>& items, std::size_t first, std::size_t last);
  PartSums gradients(const std::vector<StepItem>& items, std::size_t first, std::size_t last, bool recompute);
  struct Part {
    PartSums sums;
    std::vector<float> gradients;
    std::string kind;  // of the device that computed it
  };
  // The parts of a rank: [first, last).
  std::pair<std::size_t, std::size_t> parts_of(int rank) const;
  std::size_t first_object(std::size_t part) const;
  // This rank's parts on all of its devices, told in order, one at a time, on any thread.
  void compute_parts(const std::vector<StepItem>& items, const std::function<void(Part)>& done);
  // Of all objects, in the order of parts, from all ranks.
  PartSums gradients_in_parts(const std::vector<StepItem>& items);
  std::vector<std::size_t> owners(const std::vector<Trainer*>& workers) const;
  void keep_kinds(const std::vector<std::string>& kinds);
  std::string kind() const;  // of its device
  // Of the weights that are moved, one tensor after the other, the same order on every device.
  std::vector<float> read_moved(Tensor LearntTensor::*what) const;
  void write_moved(Tensor LearntTensor::*what, const std::vector<float>& values) const;
  // Forward and drawing in memory that was made for it; `memory` becomes what it took. `planned`: selected voxels, on a
  // context that plans.
  DrawnPass draw_in_memory(Context& ctx, const Network& network, const StepObject& object, PassOptions options,
                           ObjectMemory& memory, long planned) const;
  void make_memory(Context& ctx, const Network& network, const StepObject& object, PassOptions options,
                   ObjectMemory& memory) const;
  long rounded(long selected) const;
  // Whether an object fits; `out` becomes what it takes, also where it does not.
  bool plan_object(Plan& out, ObjectMemory memory, long selected, std::optional<std::uint64_t> intersections,
                   bool network_alone) const;
  [[noreturn]] void refuse(double loss) const;

  Context& ctx_;
  TrainConfig config_;
  long planned_;  // voxels
  ObjectMemory memory_;
  long step_ = 0;
  LearntWeights weights_;
  std::vector<Moments> moments_;     // of each run
  std::vector<SideBySide> average_;  // of each run, where there is one
  std::map<std::string, std::string> state_;
  std::vector<std::unique_ptr<Trainer>> helpers_;
  std::vector<float> moved_;  // the weights for the helpers
  bool computes_ = true;      // parts; not once its device had failed
  Ranks* ranks_ = nullptr;    // none: this process alone
};

}  // namespace vsplat

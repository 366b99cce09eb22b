// Training: the weights and the optimiser's state on the device, and the step that moves them.
#pragma once
#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "model/checkpoint.h"
#include "model/data/training_views.h"
#include "model/learnt_weights.h"
#include "model/training_pass.h"

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
  double loss = 0;                   // both levels
  double psnr = 0, psnr_coarse = 0;  // from the mean squared error over novel views (input views, where there are no
                                     // others); where `levels` is "coarse" they are equal
  double selected = 0;               // share of the voxels
  double gradient_norm = 0;          // before clipping
  std::uint64_t intersections = 0;   // the most in a picture
  long most_selected = 0;            // voxels, of the objects
};

class Trainer {
 public:
  // Goes on from `start`; its step 0 has no moments. Uploads.
  Trainer(Context& ctx, const Checkpoint& start);

  const TrainConfig& config() const { return config_; }
  long step() const { return step_; }  // steps done
  const LearntWeights& weights() const { return weights_; }

  // One step of the optimiser on batch * accumulate objects. Waits for the device. Where the loss or a gradient is no
  // number, or infinite, the weights and the state stay, and an Error(internal) names the step and the first tensor.
  StepReport step(const std::vector<StepItem>& items);

  // Everything, read back.
  Checkpoint checkpoint() const;

  // Bytes on the device, with `selected` of the voxels selected and so many intersections in each picture (none: as
  // many as there could be): what is there now, and a step.
  struct Plan {
    std::size_t weights = 0;  // with gradients, moments and average
    std::size_t peak = 0;     // in all
    long selected = 0;        // voxels
    std::vector<StageMemory> stages;
  };
  Plan plan(double selected, std::optional<std::uint64_t> intersections) const;

 private:
  struct Moments {
    Tensor m, v;
  };
  PassViews upload(Context& ctx, const StepItem& item) const;
  [[noreturn]] void refuse(double loss) const;

  Context& ctx_;
  TrainConfig config_;
  long step_ = 0;
  LearntWeights weights_;
  std::map<std::string, Moments> moments_;  // of what is trained
  std::map<std::string, Tensor> average_;
  std::map<std::string, std::string> state_;
};

}  // namespace vsplat

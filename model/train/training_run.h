// A whole training: reads data, writes a run's folder.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/data/data_set.h"
#include "model/train/trainer.h"

namespace vsplat {

class RankLeader;

// Estimates the memory of a training with this configuration, on a context without allocations for it. `bound`: assumes
// that all voxels are selected and every Gaussian touches every tile.
struct TrainPlanOptions {
  std::string selection;
  long selected = 0;  // voxels; ignored if `selection` names a file
  std::optional<std::uint64_t> intersections;
  bool bound = false;
};
Trainer::Plan plan_train(const Context& ctx, const TrainConfig& config, const TrainPlanOptions& options);
// Runs a whole step on a plan, including the optimiser: to list its launches.
void plan_step(const Context& ctx, const TrainConfig& config, const TrainPlanOptions& options);

// Means over the steps since the last report of progress.
struct TrainProgress {
  StepReport report;              // its step, learning rate and temperature are the last step's; counts are the maximum
  long steps = 0;                 // of the whole training
  double seconds = 0;             // of this run so far
  double objects_per_second = 0;  // since the last report of progress
  double seconds_left = 0;        // extrapolated from the steps so far that compiled nothing; 0: unknown yet
};

struct TrainOptions {
  std::string output;  // the run's folder; created if it does not exist
  std::string run;     // folder of the run, if this is one of its stages; its page shows the stage; "": output
  // model file with the initial weights; must match the configuration's model; "": random weights, by the seed
  std::string init;
  // continue from the newest valid checkpoint in `output`, which must have the same configuration
  bool resume = false;
  // Overrides the configuration's Schedule::extend. Empty: that one, or the checkpoint's if the configuration has none.
  // Needs `resume`. Extensions that have begun may not change: the same list again adds none.
  std::vector<long> extend;
  bool skip_bad = false;      // skip and count data that cannot be read
  std::string textures = "";  // folder of pictures for procedural objects; "": no textures
  std::string
      selection;  // a file of voxels that are refined in every step, see model/io/archive/selection_file.h; "": none
  long planned_selected = 0;                           // voxels, as in Trainer; used if `selection` is empty
  long planned_in_sheet = 0;                           // voxels for a sheet, which is rendered as at inference
  std::optional<std::uint64_t> assumed_intersections;  // for the check before the start, as in Trainer::plan
  std::vector<Context*> helpers;                       // devices that compute shards besides the main one
  RankLeader* leader = nullptr;                        // on rank 0 if there are other processes, else null
  // Every `log_every` steps, and after the last.
  std::function<void(const TrainProgress&)> on_progress;
  // Called when a file was written, and for single notes: "checkpoint RUN/checkpoint-00000500.safetensors".
  std::function<void(const std::string&)> on_message;
  // Called after every step. On true, a checkpoint is written and the training ends.
  std::function<bool()> stop;
};

struct TrainResult {
  long step = 0;         // steps done
  bool stopped = false;  // before the last step
  std::string model;     // the file for inference
  int bad = 0;           // views and objects skipped
  std::size_t peak = 0;  // peak of allocated device memory, in bytes
};

// Writes into `output`: config.json, log.csv, sheets/step-00000500.png, checkpoint-00000500.safetensors (the newest
// few) and, with every checkpoint, model.safetensors. Also writes record.json, and report.html (report.h) in the run's
// folder; the training continues without these two if they cannot be written. Equal configuration, data, device and
// seed give the same bits, however often the run was interrupted. Error(usage) if the folder holds checkpoints and
// `resume` is false, or if they belong to another configuration. Error(format) if `init` does not match the model.
// Errors of data as in TrainingReader. Error(memory) before anything is written if a step would not fit.
TrainResult train(Context& ctx, const TrainConfig& config, const DataSet& data, const TrainOptions& options);

}  // namespace vsplat

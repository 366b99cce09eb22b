// A training from beginning to end: data in, a run's folder out.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/data/data_set.h"
#include "model/train/trainer.h"

namespace vsplat {

class RankLeader;

// What a training of that configuration would take, on a context on which nothing was made for it; `bound`: with all
// voxels selected and every Gaussian in every tile.
struct TrainPlanOptions {
  std::string selection;
  long selected = 0;  // voxels, where `selection` names no file
  std::optional<std::uint64_t> intersections;
  bool bound = false;
};
Trainer::Plan plan_train(const Context& ctx, const TrainConfig& config, const TrainPlanOptions& options);
// A whole step of it on a plan, the optimiser's part, too: for lists of what it launches.
void plan_step(const Context& ctx, const TrainConfig& config, const TrainPlanOptions& options);

// Means over the steps since the last one that was told.
struct TrainProgress {
  StepReport report;   // its step, learning rate and temperature are the last step's; the counts are the largest
  long steps = 0;      // of the whole training
  double seconds = 0;  // of this run so far
  double objects_per_second = 0;  // since the last one
  double seconds_left = 0;        // at the pace of the steps so far that compiled nothing; 0: there was none yet
};

struct TrainOptions {
  std::string output;   // the run's folder, made where there is none
  std::string run;      // the folder of the run that this is a stage of, whose page tells of it; "": output
  std::string init;     // a model file to begin with, of the configuration's model; "": random weights, by the seed
  bool resume = false;  // go on from the newest good checkpoint in it; it must be of the same configuration
  // Schedule::extend, instead of the configuration's; empty: that, or the checkpoint's where it has none. Needs
  // `resume`. What has begun of it may not change: the same list again is no further extension.
  std::vector<long> extend;
  bool skip_bad = false;      // data that cannot be read are passed over and counted
  std::string textures = "";  // a folder of pictures for procedural objects; "": none
  std::string
      selection;  // a file of voxels that are refined in every step, see model/io/archive/selection_file.h; "": none
  long planned_selected = 0;                           // voxels, as the trainer takes it, where none are given
  long planned_in_sheet = 0;                           // the same of a sheet, which is drawn as at inference
  std::optional<std::uint64_t> assumed_intersections;  // for the check before the start, as Trainer::plan has them
  std::vector<Context*> helpers;                       // devices that compute parts of a step beside the training's own
  RankLeader* leader = nullptr;                        // rank 0's, where other processes compute parts, too; else none
  // Every `log_every` steps, and after the last.
  std::function<void(const TrainProgress&)> on_progress;
  // Something was written, or is told once: "checkpoint RUN/checkpoint-00000500.safetensors".
  std::function<void(const std::string&)> on_message;
  // Asked after every step; true: a checkpoint is written and the training ends.
  std::function<bool()> stop;
};

struct TrainResult {
  long step = 0;         // steps done
  bool stopped = false;  // before the last
  std::string model;     // the file for inference
  int bad = 0;           // views and objects passed over
  std::size_t peak = 0;  // bytes of device memory that were held at the most
};

// Writes into `output`: config.json, log.csv, sheets/step-00000500.png, checkpoint-00000500.safetensors (the newest
// few) and, with every checkpoint, model.safetensors; beside them record.json and, into the run's folder,
// report.html (report.h), without which it goes on where they cannot be written. The same configuration, data,
// device and seed give the same bits, however often the run was interrupted. Error(usage) where the folder holds
// checkpoints and `resume` is not asked for, or those of another configuration; Error(format) where `init` is of
// another model; errors of data as TrainingReader has them. Error(memory) before anything is written where a step
// would not fit.
TrainResult train(Context& ctx, const TrainConfig& config, const DataSet& data, const TrainOptions& options);

}  // namespace vsplat

// A training from beginning to end: data in, a run's folder out.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/data/data_set.h"
#include "model/trainer.h"

namespace vsplat {

// Means over the steps since the last one that was told.
struct TrainProgress {
  StepReport report;   // its step, learning rate and temperature are the last step's; the counts are the largest
  long steps = 0;      // of the whole training
  double seconds = 0;  // of this run so far
  double objects_per_second = 0;  // since the last one
  double seconds_left = 0;        // at that pace
};

struct TrainOptions {
  std::string output;     // the run's folder, made where there is none
  bool resume = false;    // go on from the newest good checkpoint in it; it must be of the same configuration
  bool skip_bad = false;  // data that cannot be read are passed over and counted
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
};

// Writes into `output`: config.json, log.csv, sheets/step-00000500.png, checkpoint-00000500.safetensors (the newest
// few) and, with every checkpoint, model.safetensors. The same configuration, data, device and seed give the same bits,
// however often the run was interrupted. Error(usage) where the folder holds checkpoints and `resume` is not asked for,
// or those of another configuration; errors of data as TrainingReader has them.
TrainResult train(Context& ctx, const TrainConfig& config, const DataSet& data, const TrainOptions& options);

}  // namespace vsplat

// Checkpoints of a training: everything from which it goes on as if it had never stopped, in one safetensors file that
// appears whole or not at all, with the SHA-256 of the file in it. A run's folder holds a few, named by their step.
#pragma once
#include <map>
#include <optional>
#include <string>

#include "model/networks/params/weights.h"
#include "model/train/train_config.h"

namespace vsplat {

struct Checkpoint {
  TrainConfig config;
  long step = 0;       // steps done
  Weights parameters;  // all of parameters(config.model)
  Weights m, v;        // AdamW's moments of those parameters that it has touched: the same names in both
  Weights momentum;    // Muon's, of those that it has touched
  Weights average;     // the moving average, all of parameters(config.model); empty where config.ema is 0
  std::map<std::string, std::string> state;  // what else the trainer needs, text by name
};

// "FOLDER/checkpoint-00001200.safetensors"
std::string checkpoint_path(const std::string& folder, long step);

// Error(file) names the path, where the disk is full or the folder cannot be written; what was there before stays.
void save_checkpoint(const std::string& path, const Checkpoint& checkpoint);

// Error(format) for a file that is damaged, cut off, or no checkpoint; it names path, tensor or field, found and
// expected.
Checkpoint load_checkpoint(const std::string& path);

// Of the checkpoints in the folder the one with the highest step in its name that is good; a warning for each damaged
// one above it. Nothing where there are none; Error(format) where there are and none is good, and Error(file) where the
// folder cannot be read.
std::optional<Checkpoint> newest_checkpoint(const std::string& folder);

// Removes all but the `keep` newest, and what interrupted writes of checkpoints have left. Call it after a checkpoint
// has been saved: the newest ones are then good. Only the process that trains in the folder may.
void prune_checkpoints(const std::string& folder, long keep);

// The model for inference: the moving average where there is one. `provenance` as save_model() has it; the step, the
// seed and the training's configuration are added.
void save_model(const std::string& path, const Checkpoint& checkpoint,
                std::map<std::string, std::string> provenance = {});

}  // namespace vsplat

// Checkpoints of a training. Each is a safetensors file with the complete state, so that a resumed training gives the
// same bits. It is written atomically and contains the file's SHA-256. A run's folder keeps a few, named by their step.
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
  Weights m, v;        // AdamW's moments of the parameters that it has updated, under the same names in both
  Weights momentum;    // Muon's, of the parameters that it has updated
  Weights average;     // moving average of all of parameters(config.model); empty if config.ema is 0
  std::map<std::string, std::string> state;  // further state of the trainer, text by name
};

// "FOLDER/checkpoint-00001200.safetensors"
std::string checkpoint_path(const std::string& folder, long step);

// Error(file) names the path if the disk is full or the folder is not writable; the earlier checkpoints then stay.
void save_checkpoint(const std::string& path, const Checkpoint& checkpoint);

// Error(format) if the file is damaged, truncated or not a checkpoint. It names the path, and the tensor or field with
// its found and expected value.
Checkpoint load_checkpoint(const std::string& path);

// The valid checkpoint with the highest step in its name. Logs a warning for each damaged one above it. Returns nothing
// if the folder has no checkpoints. Error(format) if it has some and none is valid, Error(file) if the folder cannot be
// read.
std::optional<Checkpoint> newest_checkpoint(const std::string& folder);

// Removes all but the `keep` newest checkpoints, and the remains of interrupted writes. Call it after a checkpoint has
// been saved, so that the newest ones are valid. Only the process that trains in the folder may call it.
void prune_checkpoints(const std::string& folder, long keep);

// Saves the model for inference: the moving average if there is one, else the parameters. Adds the step, the seed and
// the training's configuration to `provenance`, as in save_model() of model_file.h.
void save_model(const std::string& path, const Checkpoint& checkpoint,
                std::map<std::string, std::string> provenance = {});

}  // namespace vsplat

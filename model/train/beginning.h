// What a training begins with: random weights, those of a model, or a checkpoint of its own.
#pragma once
#include <string>
#include <vector>

#include "model/train/checkpoint.h"

namespace vsplat {

// Weights by the seed.
Checkpoint random_beginning(const TrainConfig& config);

// That a model of that configuration can be begun with: Error(format) names the first field that differs, but for
// `image`, `views` and, of VS-Splat's, `volume`, which no parameter's shape depends on.
void check_model_fits(const AnyConfig& model, const TrainConfig& config);

struct Beginning {
  Checkpoint checkpoint;
  std::string told;  // what was changed of a model that it begins with, for the user; "": nothing
};

// The weights of a model file that check_model_fits(). What is in units of the cube's edge (the places of the fine
// Gaussians within their voxel) is scaled by the old number of voxels over the new one.
Beginning from_model(const TrainConfig& config, const std::string& path);

// `output`, `init`, `resume` and `extend` as TrainOptions have them, whose errors these are.
struct BeginningRequest {
  std::string output, init;
  bool resume = false;
  std::vector<long> extend = {};
};

// The newest good checkpoint in `output`, with this configuration; else what the request says.
Beginning begin(const TrainConfig& config, const BeginningRequest& request);

}  // namespace vsplat

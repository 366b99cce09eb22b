// The initial state of a training: random weights, a model's weights, or a checkpoint of the same run.
#pragma once
#include <string>
#include <vector>

#include "model/train/checkpoint.h"

namespace vsplat {

// Random weights, determined by the seed.
Checkpoint random_beginning(const TrainConfig& config);

// Checks that a training can start from such a model. Error(format) names the first field that differs. `image`,
// `views` and, in VS-Splat, `volume` may differ, since no parameter's shape depends on them.
void check_model_fits(const AnyConfig& model, const TrainConfig& config);

struct Beginning {
  Checkpoint checkpoint;
  std::string note;  // note for the user on what was changed in the initial model; "": nothing
};

// The weights of a model file that passes check_model_fits(). Lengths in units of the cube's edge (the fine Gaussians'
// offsets within their voxel) are scaled by the old number of voxels over the new one.
Beginning from_model(const TrainConfig& config, const std::string& path);

// `output`, `init`, `resume` and `extend` as in TrainOptions, with the same errors.
struct BeginningRequest {
  std::string output, init;
  bool resume = false;
  std::vector<long> extend = {};
};

// The newest valid checkpoint in `output`, with this configuration; if there is none, the start that the request names.
Beginning begin(const TrainConfig& config, const BeginningRequest& request);

}  // namespace vsplat

// Options for reading a training's data, from its configuration and options.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "model/train/training_run.h"

namespace vsplat {

TrainingOptions training_reading(const TrainConfig& config, const TrainOptions& options);

// The voxels in the file `selection`, which every step refines; nothing if `selection` is "".
std::optional<std::vector<int>> forced_selection(const TrainConfig& config, const std::string& selection);

// Number of voxels to allocate memory for: that of the forced voxels if given, else `planned`.
long planned_of(const std::optional<std::vector<int>>& voxels, long planned);

}  // namespace vsplat

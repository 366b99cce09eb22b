// What a training asks of its data, by its configuration and options.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "model/train/train.h"

namespace vsplat {

TrainingOptions training_reading(const TrainConfig& config, const TrainOptions& options);

// The voxels of a file that every step refines; none where `selection` is "".
std::optional<std::vector<int>> forced_selection(const TrainConfig& config, const std::string& selection);

// How many voxels memory is made for: the forced ones, where there are any.
long planned_of(const std::optional<std::vector<int>>& voxels, long planned);

}  // namespace vsplat

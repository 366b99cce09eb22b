// A training in stages: each a training of its own, with the weights that the one before it has left.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/train/train.h"

namespace vsplat {

// The folder of stage `i`, from 0: that of the run where there is one stage alone, else stage-1, stage-2, ... in it.
std::string stage_folder(const std::string& run, std::size_t i, std::size_t stages);

// train() of each stage, in its folder; with `resume`, from where the first one that is not done has got to.
// `options` gives those of a stage, by its configuration: `output` is the run's folder, `init` of the first stage,
// `extend` of the last, and `resume` of all. In the run's folder stand model.safetensors, of the newest stage, and
// config.json, of all. The result is the last stage's; peak and bad are of them all.
TrainResult train_stages(Context& ctx, const std::vector<TrainConfig>& stages, const DataSet& data,
                         const std::function<TrainOptions(const TrainConfig&)>& options);

}  // namespace vsplat

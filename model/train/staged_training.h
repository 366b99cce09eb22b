// Trains in stages. Each stage is a training that starts from the previous one's weights.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/train/training_run.h"

namespace vsplat {

// The folder of stage `i`, from 0: the run's folder if there is only one stage, else stage-1, stage-2, ... in it.
std::string stage_folder(const std::string& run, std::size_t i, std::size_t stages);

// Calls train() for each stage, in its folder. With `resume`, continues from the first stage that is not finished.
// `options` returns a stage's options, given its configuration. Of these, `output` is the run's folder; `init` applies
// to the first stage, `extend` to the last, and `resume` to all. Writes the newest stage's model.safetensors and all
// stages' config.json to the run's folder. Returns the last stage's result; `peak` and `bad` cover all stages.
TrainResult train_stages(Context& ctx, const std::vector<TrainConfig>& stages, const DataSet& data,
                         const std::function<TrainOptions(const TrainConfig&)>& options);

}  // namespace vsplat

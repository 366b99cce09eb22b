// A picture that shows a model's result for one object.
#pragma once
#include "model/base/image.h"
#include "model/data/training_views.h"
#include "model/networks/network.h"

namespace vsplat {

// One row per view, input views first: the picture, the coarse level, the fine level, and the selected voxels, coloured
// by position. Without noise, as at inference. `planned_selected`: as in ForwardOptions.
Image training_sheet(Context& ctx, const Network& network, const TrainingViews& views, double temperature,
                     long planned_selected);

}  // namespace vsplat

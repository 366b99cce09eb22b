// What a model makes of one object, to be looked at.
#pragma once
#include "model/base/image.h"
#include "model/data/training_views.h"
#include "model/networks/network.h"

namespace vsplat {

// A row for each view, the input views first: the picture, the coarse level, the fine one, and the selected voxels in
// the colours of their places. Without noise, as at inference. `planned_selected`: as ForwardOptions have it.
Image training_sheet(Context& ctx, const Network& network, const TrainingViews& views, double temperature,
                     long planned_selected);

}  // namespace vsplat

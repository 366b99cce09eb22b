// Objects that a training has not seen, of those that it has: mirrored, or in other colours.
#pragma once
#include <array>

#include "model/data/training_views.h"

namespace vsplat {

// The object mirrored in the plane between its frame's left and right: pictures and cameras. The first view stays the
// reference, seen from where it was.
void mirror(TrainingViews& views);

// Channel c of all pictures is what channel order[c] was: another object, of other colours and the same light and dark.
void shuffle_channels(TrainingViews& views, const std::array<int, 3>& order);

}  // namespace vsplat

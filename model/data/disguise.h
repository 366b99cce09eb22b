// Augmentation: derives unseen objects from a training's objects by mirroring or changing colours.
#pragma once
#include <array>

#include "model/data/training_views.h"

namespace vsplat {

// Mirrors the object, its pictures and cameras, left to right in its frame. The first view stays the reference with its
// viewpoint.
void mirror(TrainingViews& views);

// Channel c of all pictures becomes the former channel order[c]: an object with other colours and the same brightness
// pattern.
void shuffle_channels(TrainingViews& views, const std::array<int, 3>& order);

}  // namespace vsplat

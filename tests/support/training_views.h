// Views of a training step on a device, as the trainer uses them.
#pragma once
#include <cstddef>

#include "model/train/trainer.h"
#include "runtime/context.h"

namespace vsplat::test {

// `image`: pixels along an edge.
inline PassViews upload_views_of_step(Context& ctx, const TrainingViews& views, long image) {
  PassViews out;
  out.inputs = ctx.upload({views.inputs, image, image, 3}, views.pictures.data());
  out.cameras = views.cameras;
  for (std::size_t v = 0; v < views.cameras.size(); ++v) {
    const float* picture = views.pictures.data() + v * static_cast<std::size_t>(image * image * 3);
    out.targets.push_back(ctx.upload({1, image, image, 3}, picture));
    out.backgrounds.push_back(views.background);
  }
  return out;
}

}  // namespace vsplat::test

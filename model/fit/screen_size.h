// Limits the screen area that Gaussians cover, and so the duration of a fit's step.
#pragma once
#include <cstdint>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

// The number of Gaussian-tile pairs that a picture may have in a step: several times what fits reach whose pictures
// show an object in its cube (measured: bench/results/README.md).
std::uint64_t affordable_tiles(const Camera& camera, long count);

struct ScreenGaussians {
  std::vector<float> means, logits;  // [K,3], [K]: as in SplatParameters
};

// Shrinks the largest Gaussians before the camera to one common size on its screen, so that all of them together touch
// at most four fifths of `most` tiles; smaller ones stay as they are. `log_scales` [K,3] are not reduced below `least`.
void shrink_on_screen(const ScreenGaussians& gaussians, const Camera& camera, float near, std::uint64_t most,
                      float least, std::vector<float>& log_scales);

}  // namespace vsplat

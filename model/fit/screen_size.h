// Bounds how much of a picture Gaussians cover, and with it how long a step of a fit takes.
#pragma once
#include <cstdint>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

// Pairs of a Gaussian and a tile that it touches, in a picture of a step: several times what fits have where pictures
// show an object in its cube (measured: bench/results/README.md).
std::uint64_t affordable_tiles(const Camera& camera, long count);

struct ScreenGaussians {
  std::vector<float> means, logits;  // [K,3], [K]: as SplatParameters has them
};

// Of the Gaussians before the camera those that are largest on its screen become smaller, all of these to one size, so
// that together they touch at most four fifths of `most` tiles; the others stay as they are. `log_scales` [K,3] are not
// made smaller than `least`.
void shrink_on_screen(const ScreenGaussians& gaussians, const Camera& camera, float near, std::uint64_t most,
                      float least, std::vector<float>& log_scales);

}  // namespace vsplat

// Prepares a given picture for comparison with a drawn one: as seen by a pinhole camera, over the same background.
#pragma once
#include <array>
#include <string>

#include "model/base/camera.h"
#include "model/base/image.h"

namespace vsplat {

struct ReferenceFiles {
  std::string picture, mask;  // `mask` may be ""
  int turning = 1;            // orientation of the picture, as in EXIF
};

// The picture, oriented, [height][width][3]. Its alpha, and the mask, scaled to its size if the aspect ratio agrees,
// composite it over `background`. The lens distortion of `camera` is undone; its intrinsics are scaled if its size
// differs. A larger picture of the same aspect ratio, within a pixel, is scaled down by area means. If the size agrees
// and the camera has no distortion, every pixel is kept. Error(input) if the picture is smaller, has another aspect
// ratio, or the mask has another one; otherwise errors as read_image().
Image reference_picture(const Camera& camera, const ReferenceFiles& files, int width, int height,
                        const std::array<float, 3>& background);

}  // namespace vsplat

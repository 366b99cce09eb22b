// A given picture as a drawn one is: what the camera would have seen as a pinhole, over the same background.
#pragma once
#include <array>
#include <string>

#include "model/base/camera.h"
#include "model/base/image.h"

namespace vsplat {

struct ReferenceFiles {
  std::string picture, mask;  // the latter may be ""
  int turning = 1;            // of the picture, as EXIF's orientation
};

// The picture, turned, [height][width][3]: its alpha, and the mask, made its size where that has its shape, over
// `background`; the lens distortion of `camera` undone, its intrinsics scaled where it has another size. A larger
// picture of the same proportions, to a pixel, is scaled down, each pixel the mean over its area. Those of that size,
// of cameras without distortion, keep every pixel. Error(input) where it is smaller or has other proportions, or
// the mask is not of its shape; else as read_image().
Image reference_picture(const Camera& camera, const ReferenceFiles& files, int width, int height,
                        const std::array<float, 3>& background);

}  // namespace vsplat

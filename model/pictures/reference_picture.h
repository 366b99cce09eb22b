// A given picture as a drawn one is: what the camera would have seen as a pinhole, over the same background.
#pragma once
#include <array>
#include <string>

#include "model/base/camera.h"
#include "model/base/image.h"

namespace vsplat {

// The picture at `path`, [height][width][3]: its alpha, and the mask at `mask_path` unless that is empty, over
// `background`; the lens distortion of `camera` undone, its intrinsics scaled where it has another size. A larger
// picture of the same proportions, to a pixel, is scaled down, each pixel the mean over its area. Those of that size,
// of cameras without distortion, keep every pixel. Error(input) where it is smaller or has other proportions, or
// the mask is not of its size; else as read_image().
Image reference_picture(const Camera& camera, const std::string& path, const std::string& mask_path, int width,
                        int height, const std::array<float, 3>& background);

}  // namespace vsplat

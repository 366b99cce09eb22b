#include "model/pictures/reference_picture.h"

#include <algorithm>

#include "model/base/lens.h"
#include "model/base/resample.h"
#include "model/io/image_file.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

// Windows are square: one that holds the picture from its first pixel on, cut to the picture.
Image undistorted(const Image& source, Camera camera) {
  const double x = static_cast<double>(source.width) / camera.width,
               y = static_cast<double>(source.height) / camera.height;
  camera.fx *= x, camera.cx *= x, camera.fy *= y, camera.cy *= y;
  camera.width = source.width, camera.height = source.height;
  const int side = std::max(source.width, source.height);
  const Image square = resample_undistorted(source, {0, 0, static_cast<double>(side), side}, camera);
  Image out(source.width, source.height, source.channels);
  for (int v = 0; v < out.height; ++v) std::copy_n(square.at(0, v), out.width * out.channels, out.at(0, v));
  return out;
}

}  // namespace

Image reference_picture(const Camera& camera, const std::string& path, const std::string& mask_path, int width,
                        int height, const std::array<float, 3>& background) {
  const Image picture = read_image(path);
  if (picture.width != width || picture.height != height)
    fail(Status::input,
         "{} is {} x {} pixels, the picture drawn for it {} x {}: give it in the same size, or draw in its", path,
         picture.width, picture.height, width, height);
  const Image mask = mask_path.empty() ? Image() : read_mask(mask_path);
  if (!mask.empty() && (mask.width != width || mask.height != height))
    fail(Status::input, "{} is {} x {} pixels, its picture {} is {} x {}: a mask must have its picture's size",
         mask_path, mask.width, mask.height, path, width, height);
  const Image source = premultiplied(picture, mask.empty() ? nullptr : &mask);
  return over(is_pinhole(camera.distortion) ? source : undistorted(source, camera), background);
}

}  // namespace vsplat

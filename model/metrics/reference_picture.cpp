#include "model/metrics/reference_picture.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "model/base/lens.h"
#include "model/base/resample.h"
#include "model/io/picture/contact_sheet.h"
#include "model/io/picture/image_file.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

// The view of a pinhole camera with the camera's intrinsics: bilinear interpolation in the source, which has the
// result's size; alpha is 0 outside. (Area resampling, as for network inputs, gives the same result where the lens does
// not stretch, for ten times the work.)
Image undistorted(const Image& source, Camera camera) {
  const double sx = static_cast<double>(source.width) / camera.width,
               sy = static_cast<double>(source.height) / camera.height;
  camera.fx *= sx, camera.cx *= sx, camera.fy *= sy, camera.cy *= sy;
  const double right = std::max(std::abs(camera.cx), std::abs(source.width - camera.cx)) / camera.fx,
               below = std::max(std::abs(camera.cy), std::abs(source.height - camera.cy)) / camera.fy;
  const Lens lens(camera.distortion, std::hypot(right, below));
  Image out(source.width, source.height, source.channels);
  for (int j = 0; j < out.height; ++j)
    for (int i = 0; i < out.width; ++i) {
      double x = 0, y = 0;
      if (!lens.distort((i + 0.5 - camera.cx) / camera.fx, (j + 0.5 - camera.cy) / camera.fy, x, y)) continue;
      const double u = camera.fx * x + camera.cx - 0.5, v = camera.fy * y + camera.cy - 0.5;
      if (!(u > -1 && v > -1 && u < source.width && v < source.height)) continue;
      const int left = static_cast<int>(std::floor(u)), top = static_cast<int>(std::floor(v));
      const auto across = static_cast<float>(u - left), down = static_cast<float>(v - top);
      for (int corner = 0; corner < 4; ++corner) {
        const int a = left + corner % 2, b = top + corner / 2;
        if (a < 0 || b < 0 || a >= source.width || b >= source.height) continue;
        const float weight = (corner % 2 ? across : 1 - across) * (corner / 2 ? down : 1 - down);
        for (int c = 0; c < out.channels; ++c) out.at(i, j)[c] += weight * source.at(a, b)[c];
      }
    }
  return out;
}

}  // namespace

Image reference_picture(const Camera& camera, const ReferenceFiles& files, int width, int height,
                        const std::array<float, 3>& background) {
  const std::string &path = files.picture, &mask_path = files.mask;
  const ImageFile file(path);
  const std::unique_ptr<PixelRows> picture = file.rows(files.turning);
  const double scaled = static_cast<double>(picture->height) * width / picture->width;
  if (picture->width < width || picture->height < height || std::abs(scaled - height) > 1)
    fail(Status::input,
         "{} is {} x {} pixels, the picture drawn for it {} x {}: give it in the same size, or larger with the same "
         "proportions, or draw in its size",
         path, picture->width, picture->height, width, height);
  std::optional<ImageFile> mask_file;
  std::unique_ptr<PixelRows> mask_picture;
  std::optional<MaskRows> mask;
  std::optional<ResizedRows> resized;
  if (!mask_path.empty()) {
    mask_file.emplace(mask_path);
    mask_picture = mask_file->rows();
    mask.emplace(*mask_picture);
    if (!is_same_shape(mask->width, mask->height, picture->width, picture->height))
      fail(Status::input, "{} is {} x {} pixels, its picture {} is {} x {}: a mask must have its picture's shape",
           mask_path, mask->width, mask->height, path, picture->width, picture->height);
    if (mask->width != picture->width || mask->height != picture->height)
      resized.emplace(*mask, picture->width, picture->height);
  }
  PixelRows* const fitting = resized ? &*resized : mask ? static_cast<PixelRows*>(&*mask) : nullptr;
  PremultipliedRows source(*picture, fitting);
  const Image small = shrunk(source, width, height);
  return over(is_pinhole(camera.distortion) ? small : undistorted(small, camera), background);
}

}  // namespace vsplat

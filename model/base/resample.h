// Resamples a window of a picture with antialiasing, and undoes lens distortion in the same step.
#pragma once
#include <array>
#include <memory>
#include <vector>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/base/pixel_rows.h"

namespace vsplat {

// Premultiplied rows [W][4] of a picture with 3 or 4 channels (straight alpha) and optionally a one-channel mask of the
// same size; the alphas multiply. Colours under alpha 0 become 0, so that resampling cannot reveal them.
class PremultipliedRows : public PixelRows {
 public:
  // Both must outlive this.
  explicit PremultipliedRows(PixelRows& picture, PixelRows* mask = nullptr);
  void next(float* row) override;
  // Maximum of the mask over the rows read so far; 0 without a mask.
  float brightest_of_mask() const { return brightest_; }

 private:
  PixelRows& picture_;
  PixelRows* mask_;
  std::vector<float> pixels_, masks_;  // one row of each
  float brightest_ = 0;
};
Image premultiplied(const Image& picture);

// Whether the two sizes have the same aspect ratio, within a pixel of the smaller one.
bool is_same_shape(int width, int height, int other_width, int other_height);

// The rows of a picture scaled to another size, independently along each axis: area average for reduction,
// interpolation for enlargement.
class ResizedRows : public PixelRows {
 public:
  // `from` must outlive this.
  ResizedRows(PixelRows& from, int width, int height);
  ~ResizedRows() override;
  void next(float* row) override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Composites over a background colour: three channels, clamped to [0,1].
Image over(const Image& premultiplied, const std::array<float, 3>& background);
Image on_white(const Image& premultiplied);

// A window of a picture in its continuous pixel coordinates (the first pixel is [0,1)): corner and width. The result
// has `size` columns, and `size` rows, or `rows` rows at the same scale if that is not 0.
struct Window {
  double x0 = 0, y0 = 0, side = 0;
  int size = 0;
  int rows = 0;

  int height() const { return rows > 0 ? rows : size; }
};

// Result pixel (i, j) shows the picture around (x0, y0) + (i + 0.5, j + 0.5) side/size: the area mean for reduction,
// bilinear interpolation for enlargement. The weights are corrected to reproduce linear ramps, so nothing is shifted.
// Result pixels that the picture covers partly have that fraction as alpha; without scaling, pixels are copied exactly.
// All rows are read, including those outside the window.
Image resample(PixelRows& premultiplied, const Window& window);

// As resample(), for the undistorted picture: the view of a pinhole camera with the camera's fx, fy, cx, cy. The
// camera's distortion maps it to positions in `premultiplied`.
Image resample_undistorted(PixelRows& premultiplied, const Window& window, const Camera& camera);

}  // namespace vsplat

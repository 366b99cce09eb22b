// A window of a picture at another resolution, antialiased, with lens distortion undone in the same step.
#pragma once
#include <array>
#include <memory>
#include <vector>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/base/pixel_rows.h"

namespace vsplat {

// Premultiplied rows [W][4] of a picture of 3 or 4 channels (straight alpha) and, where given, a mask of one and of the
// same size; their alphas multiply. What is behind alpha 0 is gone, so that no resampling brings it back.
class PremultipliedRows : public PixelRows {
 public:
  // Both must outlive this.
  explicit PremultipliedRows(PixelRows& picture, PixelRows* mask = nullptr);
  void next(float* row) override;
  // Of the rows so far; 0 without a mask.
  float brightest_of_mask() const { return brightest_; }

 private:
  PixelRows& picture_;
  PixelRows* mask_;
  std::vector<float> pixels_, masks_;  // a row of each
  float brightest_ = 0;
};
Image premultiplied(const Image& picture);

// Whether one is a smaller copy of the other: its sides are in proportion, to a pixel of the smaller one.
bool is_same_shape(int width, int height, int other_width, int other_height);

// Rows of a picture made another size, each axis by itself: by area where it is made smaller, interpolated where it is
// made larger.
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

// Over a colour, three channels, clamped to [0,1].
Image over(const Image& premultiplied, const std::array<float, 3>& background);
Image on_white(const Image& premultiplied);

// A window of a picture, in its pixels (continuous: the first pixel is [0,1)): corner and width. `size` pixels along
// its width result, and as many along its height, or `rows` of the same scale where that is not 0.
struct Window {
  double x0 = 0, y0 = 0, side = 0;
  int size = 0;
  int rows = 0;

  int height() const { return rows > 0 ? rows : size; }
};

// Pixel (i, j) of the result is the picture about (x0, y0) + (i + 0.5, j + 0.5) side/size: the mean over its area where
// the picture is made smaller, bilinear interpolation where larger; the weights are corrected to reproduce linear
// ramps, so that nothing is shifted. Result pixels that the picture covers in part have that part as alpha; without
// scaling, pixels are kept exactly. Every row is read, those outside the window, too.
Image resample(PixelRows& premultiplied, const Window& window);

// The same of the undistorted picture: what a pinhole with the camera's fx, fy, cx, cy would see. The camera's
// distortion says where in `premultiplied` that is.
Image resample_undistorted(PixelRows& premultiplied, const Window& window, const Camera& camera);

}  // namespace vsplat

// A drawing of a scene compared with a photograph of the same camera.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/metrics/lpips_distance.h"
#include "model/views/photographs.h"

namespace vsplat {

struct ComparedPhotograph {
  Camera camera;                    // a pinhole of the picture's size, in the world
  Image picture;                    // [H][W][3], over the background
  std::vector<std::uint8_t> known;  // [H][W]: 0 for pixels that neither lens nor mask shows; empty: all are known
};

// Reads the photograph: undistorted, its longer side at most `longest` pixels (0: unscaled), alpha and mask composited
// over `background`. Errors as those of LoadedPhotograph.
ComparedPhotograph compared_photograph(const Photographs& photographs, int view, int longest,
                                       const std::array<float, 3>& background);

struct PictureScores {
  double psnr = 0, psnr_cc = 0, ssim = 0, lpips_alex, lpips_vgg;  // LPIPS: NaN if not requested

  PictureScores();
};

// `drawn` [H][W][3] is clamped to [0,1]; where the photograph is unknown, it is taken to have the drawing's colours.
// PSNR is of the known pixels alone, and SSIM of the windows that hold one, as a fit measures them (fitter.h); both are
// NaN if no pixel is known.
PictureScores compare_drawing(Context& ctx, Image& drawn, const ComparedPhotograph& given,
                              const std::vector<const Lpips*>& lpips);

// The mean of every score, over the pictures that have a known pixel; NaN if none has.
PictureScores mean_of(const std::vector<PictureScores>& scores);

}  // namespace vsplat

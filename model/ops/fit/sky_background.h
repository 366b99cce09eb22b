// A sky behind a picture, spherical harmonics of degree 4 over directions, with its derivative; see
// cl/fit/sky_background.cl.
#pragma once
#include "model/ops/render/rasterize.h"

namespace vsplat {

// Coefficients of a channel: as in cl/fit/sky_background.cl.
constexpr long kSkyBasis = 25;

struct SkyBackgroundForward {
  Tensor sh;            // f32 [25,3]
  Tensor camera;        // f32 [1,32]: of upload_views()
  DevicePicture drawn;  // over black
  Tensor out;           // f32 [H,W,3], written: over the sky
};
void sky_background_forward(Context& ctx, const SkyBackgroundForward& a);

struct SkyBackgroundBackward {
  Tensor sh, camera;
  DevicePicture drawn;
  PictureGradient dpicture;  // colour: by `out`, and so by the drawn colour; alpha: added to
  Tensor dsh;                // f32 [25,3], written
};
void sky_background_backward(Context& ctx, const SkyBackgroundBackward& a);

}  // namespace vsplat

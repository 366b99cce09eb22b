// Gradients of a loss on a picture with respect to the Gaussians that render() drew and to the camera's pose.
#pragma once
#include <array>
#include <functional>
#include <vector>

#include "model/ops/render/rasterize.h"
#include "model/render/render.h"

namespace vsplat {

// One element per chunk of the scene.
using SceneGradient = std::vector<GaussianGradients>;
SceneGradient zero_gradient(Context& ctx, const GaussianChunks& scene);
Gaussians download(Context& ctx, const SceneGradient& gradient, int sh_degree);

// For volumes in one chunk: PictureGradient::depth is a value of each pixel instead of a derivative, and each
// Gaussian's sum over pixels of blending weight times value is added to `to`.
struct PixelSums {
  Tensor to;  // f32 [K]; none: no sums, and depth is a derivative
  // Whether a Gaussian that covers more than half of the picture gets a sum above all others (splat_scores()).
  bool wide_first = false;
};

// Draws the picture again, with the surfel maps that have gradients, and adds to `out` the derivatives of a loss whose
// derivatives by the picture are `gradient`. The derivatives are exact for fixed tiles, order and culling, and bitwise
// reproducible. `pose`, if not null: derivatives by (omega, tau) at 0, where the pose is exp([omega, tau]) times world
// to camera. Waits for the device.
void render_backward(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                     const PictureGradient& gradient, const SceneGradient& out, std::array<double, 6>* pose,
                     const PixelSums& sums = {});

// Combines render(), with the maps in `options`, and render_backward() with the result of `loss` on the picture. The
// picture is not drawn twice if it is a single part. `loss` also runs on planning contexts. `pose` and `sums` as for
// render_backward().
using PictureLossWork = std::function<PictureGradient(Context&, const DevicePicture&)>;
struct DrawnPicture {
  DevicePicture picture;
  std::uint64_t intersections = 0;  // Gaussian-tile pairs
};
DrawnPicture render_with_backward(Context& ctx, const GaussianChunks& scene, const Camera& camera,
                                  const RenderOptions& options, const PictureLossWork& loss, const SceneGradient& out,
                                  std::array<double, 6>* pose = nullptr, const PixelSums& sums = {});

// How strongly a loss on the picture pulls at each Gaussian's screen position: draws the picture again and adds to
// `out` [K,2] the sums over pixels of |dE/du| width/2 and |dE/dv| height/2, with the Gaussians' shapes fixed. For
// volumes in one chunk. `loss` also runs on planning contexts.
void screen_pulls(Context& ctx, const DeviceGaussians& scene, const Camera& camera, const RenderOptions& options,
                  const PictureLossWork& loss, Pulls pulls, const Tensor& out);

}  // namespace vsplat

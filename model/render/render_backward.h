// Gradients of a loss on a picture: by the Gaussians that render() drew, and by the camera's pose.
#pragma once
#include <array>
#include <functional>
#include <vector>

#include "model/ops/render/rasterize.h"
#include "model/render/render.h"

namespace vsplat {

// Chunk by chunk, as the scene is.
using SceneGradient = std::vector<GaussianGradients>;
SceneGradient zero_gradient(Context& ctx, const GaussianChunks& scene);
Gaussians download(Context& ctx, const SceneGradient& gradient, int sh_degree);

// Draws the picture once more, with what maps of surfels there are gradients of, and adds to `out` the derivatives of a
// loss whose derivatives by the picture are `gradient`. They are the true ones, with tiles, order and what is left out
// held as they are; the same bits every time. `pose`, where it is not null: by (omega, tau) at 0, where the pose is
// exp([omega, tau]) times world to camera. Waits for the device.
void render_backward(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                     const PictureGradient& gradient, const SceneGradient& out, std::array<double, 6>* pose);

// render(), with the maps that the options ask for, then render_backward() with what `loss` makes of the picture,
// without drawing it twice where it is one part. `loss` is run on a plan, too. `pose`: as render_backward() has it.
using PictureLossWork = std::function<PictureGradient(Context&, const DevicePicture&)>;
struct DrawnPicture {
  DevicePicture picture;
  std::uint64_t intersections = 0;  // of Gaussians with tiles
};
DrawnPicture render_with_backward(Context& ctx, const GaussianChunks& scene, const Camera& camera,
                                  const RenderOptions& options, const PictureLossWork& loss, const SceneGradient& out,
                                  std::array<double, 6>* pose = nullptr);

// How much a loss on the picture pulls at each Gaussian's place on the screen: the picture is drawn once more, and to
// `out` [K,2] the sums over its pixels of |dE/du| width/2 and |dE/dv| height/2 are added, with Gaussians' shapes held.
// Volumes alone, in one chunk. `loss` is run on a plan, too.
void screen_pulls(Context& ctx, const DeviceGaussians& scene, const Camera& camera, const RenderOptions& options,
                  const PictureLossWork& loss, Pulls pulls, const Tensor& out);

}  // namespace vsplat

// Pictures of Gaussians: 3D Gaussian splatting, as its original rasteriser defines it. Cameras are drawn as pinholes.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "model/camera.h"
#include "model/gaussians.h"
#include "model/image.h"
#include "model/ops/rasterize.h"
#include "runtime/context.h"

namespace vsplat {

struct RenderOptions {
  std::array<float, 3> background{1, 1, 1};
  float near = 0.2f;                           // camera z up to which Gaussians are left out, world units
  std::optional<std::array<float, 3>> mirror;  // colours as seen from the camera's mirror image about this point
  double assumed_tiles = 8;                    // a plan cannot count: touched by each Gaussian, on average
};

struct Picture {
  Image colour;  // 3 channels, over the background, not clamped
  Image alpha;   // 1 channel
  Image depth;   // 1 channel: sum of weight x camera z
};

// One camera, on the device. Waits once: for the number of intersections.
DevicePicture render(Context& ctx, const DeviceGaussians& gaussians, const Camera& camera,
                     const RenderOptions& options);
Picture render_picture(Context& ctx, const DeviceGaussians& gaussians, const Camera& camera,
                       const RenderOptions& options);
Picture download(Context& ctx, const DevicePicture& picture);

// Projects and counts, then stops: the pairs of tiles and Gaussians, which set what render() needs of memory.
std::uint64_t count_intersections(Context& ctx, const DeviceGaussians& gaussians, const Camera& camera,
                                  const RenderOptions& options);

}  // namespace vsplat

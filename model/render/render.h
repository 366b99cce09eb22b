// Pictures of Gaussians: 3D Gaussian splatting, and 2D where they are surfels, as their original rasterisers define it.
// Cameras are drawn as pinholes.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/ops/render/rasterize_surfels.h"
#include "model/render/gaussian_chunks.h"
#include "runtime/context.h"

namespace vsplat {

struct RenderOptions {
  std::array<float, 3> background{1, 1, 1};
  float near = 0.2f;                           // camera z up to which Gaussians are left out, world units
  std::optional<std::array<float, 3>> mirror;  // colours as seen from the camera's mirror image about this point
  bool exact_tiles = false;                    // as BinOptions::exact: the same picture, sorted from fewer pairs
  // Samples along a pixel's edge: drawn in so many times the width and height, of which each pixel is the mean. At
  // least 1; of pictures alone, not of their derivatives.
  int supersample = 1;
  // A plan cannot count what a part of the picture sees. Where this is given it is asked; otherwise every Gaussian is
  // taken to be seen and to touch `assumed_tiles`.
  std::function<VisibleCount(const Part&)> counts;
  double assumed_tiles = 8;
  // Of surfels alone. Maps that are asked for where volumes are drawn are refused.
  SurfelMaps maps = {};
  SurfelRevision revision = SurfelRevision::lara;
};

struct Picture {
  Image colour;  // 3 channels, over the background, not clamped
  Image alpha;   // 1 channel
  Image depth;   // 1 channel: sum of weight x camera z
  // What was asked for of surfels, see DevicePicture; else empty.
  Image normal{};      // 3 channels
  Image median{};      // 1 channel
  Image distortion{};  // 1 channel
};

// One camera, on the device. Waits once for each part of the picture that is drawn by itself (one, where memory
// allows): what it sees sets the size of what follows. Throws Error(memory) where not even a single tile can be drawn.
DevicePicture render(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options);
// Into tensors of the caller's, as DevicePicture has them: all three, and the maps that are asked for.
void render_into(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                 const DevicePicture& out);
Picture render_picture(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options);
Picture download(Context& ctx, const DevicePicture& picture);

// One picture's part at a time: what it sees, projected and binned. The picture is one part where that fits into
// memory, else its halves, and theirs. `slots`: as tile_bin takes it. `work` is also run on a context that only plans.
// A part that surfels see has their records.
using PartWork = std::function<void(Context&, const Part&, const Projected&, const Binned&)>;
void for_each_part(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                   bool slots, const PartWork& work);

// A picture for what is drawn, on the device, once there is room for it.
DevicePicture picture_in_room(Context& ctx, const GaussianChunks& scene, const Camera& camera, const SurfelMaps& maps);
// Blends what a part sees into its picture.
void draw_part(Context& ctx, const GaussianChunks& scene, const RenderOptions& options, const Part& part,
               const Projected& projected, const Binned& binned, const DevicePicture& picture);

// What render() would take: runs it on `planner`, as made from `ctx`, with the scene as the plan has it, for which
// `ctx` projects `scene` and counts.
void plan_render(Context& ctx, const GaussianChunks& scene, Context& planner, const GaussianChunks& planned,
                 const Camera& camera, const RenderOptions& options);

}  // namespace vsplat

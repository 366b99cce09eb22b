// Draws Gaussians: 3D Gaussian splatting for volumes and 2D Gaussian splatting for surfels, as their original
// rasterisers define them. Cameras are drawn as pinholes.
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
#include "model/render/reserve.h"
#include "runtime/context.h"

namespace vsplat {

struct RenderOptions {
  std::array<float, 3> background{1, 1, 1};
  float near = 0.2f;                           // camera z up to which Gaussians are omitted, world units
  std::optional<std::array<float, 3>> mirror;  // colours as seen from the camera's mirror image about this point
  bool exact_tiles = false;                    // as BinOptions::exact: the same picture from fewer sorted pairs
  bool antialias = false;                      // as for project_cull(); surfels are drawn without
  // Samples along a pixel's edge: the picture is drawn with so many times the width and height, and averaged. At least
  // 1; for drawing only, not for derivatives.
  int supersample = 1;
  // A plan cannot count what a part of the picture sees. It calls this if it is set; otherwise it assumes that every
  // Gaussian is visible and touches `assumed_tiles` tiles.
  std::function<VisibleCount(const Part&)> counts;
  double assumed_tiles = 8;
  // A part of the picture with more pairs of Gaussians and tiles is halved, even if they would fit into memory; 0:
  // none. Gradients depend on the parts in their last bits.
  std::uint64_t most_pairs = 0;
  // Called with the number of pairs of Gaussians and tiles in the whole picture, before it is drawn. If it returns
  // true, it has changed the Gaussians, and they are culled again.
  std::function<bool(std::uint64_t pairs)> counted;
  // If set, pictures that are no larger than earlier ones with the same pointer are not planned again. Drawings whose
  // derivatives need the same memory each time share one.
  RepeatedWork* repeated = nullptr;
  // For surfels only; requesting maps of volumes is an error.
  SurfelMaps maps = {};
  SurfelRevision revision = SurfelRevision::lara;
};

struct Picture {
  Image colour;  // 3 channels, over the background, not clamped
  Image alpha;   // 1 channel
  Image depth;   // 1 channel: sum of weight x camera z
  // The maps of surfels that were requested, see DevicePicture; otherwise empty.
  Image normal{};      // 3 channels
  Image median{};      // 1 channel
  Image distortion{};  // 1 channel
};

// Draws one camera's picture on the device. Waits once for each part of the picture that is drawn separately (a single
// one if memory allows), because the number of visible Gaussians determines later sizes. Error(memory) if not even a
// single tile can be drawn.
DevicePicture render(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options);
// Draws into the caller's tensors as in DevicePicture: all three, and the requested maps.
void render_into(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                 const DevicePicture& out);
Picture render_picture(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options);
Picture download(Context& ctx, const DevicePicture& picture);

// Calls `work` for each part of a picture with its projected and binned Gaussians. If the whole picture does not fit
// into memory, it is halved repeatedly. `slots` as for tile_bin. `work` also runs on planning contexts. Parts of surfel
// scenes have surfel records.
using PartWork = std::function<void(Context&, const Part&, const Projected&, const Binned&)>;
void for_each_part(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options,
                   bool slots, const PartWork& work);

// Allocates the device picture, after reserving memory for it.
DevicePicture reserved_picture(Context& ctx, const GaussianChunks& scene, const Camera& camera, const SurfelMaps& maps);
// Blends the Gaussians of a part into the picture.
void draw_part(Context& ctx, const GaussianChunks& scene, const RenderOptions& options, const Part& part,
               const Projected& projected, const Binned& binned, const DevicePicture& picture);

// Memory that render() would need: runs it on `planner`, made from `ctx`, with the planned scene, using counts that
// `ctx` measures on `scene`.
void plan_render(Context& ctx, const GaussianChunks& scene, Context& planner, const GaussianChunks& planned,
                 const Camera& camera, const RenderOptions& options);

}  // namespace vsplat

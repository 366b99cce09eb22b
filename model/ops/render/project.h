// Projects Gaussians to the picture: 2D Gaussians, colours, depths and the tiles that they may touch; with the
// derivative.
#pragma once
#include <array>
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/base/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

class Dims;

constexpr int kTile = 16;  // pixels along a tile's edge
inline long tiles_along(long pixels) { return (pixels + kTile - 1) / kTile; }

// Cameras in the format of cl/render/project.cl, pinhole (distortion is ignored): f32 [V,32].
Tensor upload_views(Context& ctx, const std::vector<Camera>& cameras, float near,
                    const std::optional<std::array<float, 3>>& mirror);

// Gaussians per work-item of a projection: 1 for compilers that split vectors.
long projection_width(const Context& ctx);
// Binds the shapes of a scene's arrays, with `n` as the label of the number of Gaussians; S is set in `d`, too.
void bind_gaussians(Dims& d, const DeviceGaussians& g, const char* n, GaussianKind kind);
// Checks the sizes n, V and K in `d`: fails if culling cannot handle them.
void check_culling(const Dims& d, long view, long base, int width, int height);

// Numbers of a record.
constexpr long kRecord = 12;

// Culling's results for every Gaussian of a scene, in one view; see cl/render/project.cl.
struct Culled {
  Tensor rects;  // u32 [K,2]: tiles of the picture that it may touch; 0, 0 if culled
  Tensor keys;   // u32 [K]: order as depth does
  Tensor sums;   // u64 [blocks,4]: see visible.h
};

// The visible Gaussians of a view.
struct Projected {
  Tensor ids;        // u32 [V]: indices into the scene, ascending
  Tensor rects;      // u32 [V,2]: tiles in a part of the picture, relative to its corner
  Tensor keys;       // u32 [V]: order as depth does
  int key_bits = 0;  // of the largest key
  Tensor records;    // f32 [V,12], of surfels (project_surfels.h) [V,20]
  Tensor camera;     // upload_views' [1,32], as for_each_part() fills it in
};

// A chunk of the scene, whose first Gaussian is the scene's `base`, in one view: `view` of upload_views' [V,32]; width
// and height in pixels. Writes its part of `out`. `antialias`, here and below: opacities are multiplied by
// sqrt(det S / det(S + 0.3 I)), where S is the covariance in the picture, in pixels^2.
void project_cull(Context& ctx, const DeviceGaussians& chunk, long base, const Tensor& views, long view, int width,
                  int height, const Culled& out, bool antialias = false);

// Writes the records of some visible Gaussians, all of which are in the chunk.
struct ProjectForward {
  DeviceGaussians chunk;
  long base = 0;  // the scene's index of the chunk's first Gaussian
  Tensor views;   // [V,32]
  long view = 0;
  Tensor ids;            // u32 [N]: see Projected
  long from = 0, n = 0;  // the n from `from` on
  Tensor records;        // [N,12], of which those are written
  bool antialias = false;
};
void project_forward(Context& ctx, const ProjectForward& a);

// The gradient of a picture, summed for each Gaussian in each tile: a row per intersection of the two, at the place
// given by Binned::slots. For the columns see cl/render/rasterize_backward.cl (for surfels
// cl/render/rasterize_surfels_backward.cl).
struct IntersectionGradients {
  Tensor rows;     // f32 [M,10], for surfels [M,20]; for pulls [M,2]
  Tensor touched;  // u8 [M]: 1 if the row was written; other rows count as zeros and are not written
};

// Gradients of a chunk's Gaussians, and of the camera's pose.
struct ProjectBackward {
  DeviceGaussians chunk;
  long base = 0;  // the scene's index of the chunk's first Gaussian
  Tensor views;   // [V,32]
  long view = 0;
  bool mirrored = false;  // upload_views() was given a mirror point
  Projected visible;      // N of them
  Tensor offsets;         // u32 [N + 1]: from Binned
  IntersectionGradients intersections;
  GaussianGradients dchunk;  // of the chunk, added to
  Tensor pose_gradients;     // [N,6] or none: a row for each visible Gaussian; those of the chunk are written
  bool antialias = false;
};
void project_backward(Context& ctx, const ProjectBackward& a);

// f32 [6]: the gradient by (omega, tau) at 0, where the pose is exp([omega, tau]) times world to camera.
Tensor sum_pose_gradients(Context& ctx, Tensor pose_gradients);

// The magnitude of the loss's derivatives by each Gaussian's place on the screen (rasterize_backward() with Pulls).
struct ProjectPulls {
  Projected visible;                    // N of them
  Tensor offsets;                       // u32 [N + 1]: from Binned
  IntersectionGradients intersections;  // rows [M,2]
  double by_u = 1, by_v = 1;            // factors of the sums
  Tensor pulls;                         // f32 [K,2], for the whole scene: added to
};
void project_pulls(Context& ctx, const ProjectPulls& a);
// pulls [K,2] -> [K]
Tensor pull_lengths(Context& ctx, const Tensor& pulls);

}  // namespace vsplat

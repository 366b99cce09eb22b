// Gaussians to the picture: 2D Gaussians, colours, depths and the tiles they may touch.
#pragma once
#include <array>
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/base/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

constexpr int kTile = 16;  // pixels along a tile's edge
inline long tiles_along(long pixels) { return (pixels + kTile - 1) / kTile; }

// Cameras as cl/project.cl reads them, pinhole (distortion is ignored): f32 [V,32].
Tensor upload_views(Context& ctx, const std::vector<Camera>& cameras, float near,
                    const std::optional<std::array<float, 3>>& mirror);

// Every Gaussian of a scene, in one view; see cl/project.cl.
struct Culled {
  Tensor rects;  // u32 [K,2]: tiles of the picture that it may touch; 0, 0 where culled
  Tensor keys;   // u32 [K]: order as depth does
  Tensor sums;   // u64 [blocks,4]: see visible.h
};

// Those that are seen in a view.
struct Projected {
  Tensor ids;        // u32 [V]: which of the scene's, ascending
  Tensor rects;      // u32 [V,2]: of a part of the picture, counted from its corner
  Tensor keys;       // u32 [V]: order as depth does
  int key_bits = 0;  // of the largest key
  Tensor records;    // f32 [V,12]
};

// A chunk of the scene, whose first Gaussian is the scene's `base`, in one view: `view` of upload_views' [V,32]; width
// and height in pixels. Writes its part of `out`.
void project_cull(Context& ctx, const DeviceGaussians& chunk, long base, const Tensor& views, long view, int width,
                  int height, const Culled& out);

// The records of `n` Gaussians from `from` on, all of whose ids are in the chunk.
void project(Context& ctx, const DeviceGaussians& chunk, long base, const Tensor& views, long view, const Tensor& ids,
             long from, long n, const Tensor& records);

}  // namespace vsplat

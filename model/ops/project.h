// Gaussians to the picture: 2D Gaussians, colours, depths and the tiles they may touch.
#pragma once
#include <array>
#include <optional>
#include <vector>

#include "model/camera.h"
#include "model/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

constexpr int kTile = 16;  // pixels along a tile's edge
inline long tiles_along(long pixels) { return (pixels + kTile - 1) / kTile; }

// Cameras as cl/project.cl reads them, pinhole (distortion is ignored): f32 [V,32].
Tensor upload_views(Context& ctx, const std::vector<Camera>& cameras, float near,
                    const std::optional<std::array<float, 3>>& mirror);

struct Projected {
  Tensor records;  // f32 [K,12]
  Tensor rects;    // u32 [K,2]
  Tensor counts;   // u32 [K]: tiles touched, 0 where culled
  Tensor keys;     // u32 [K]: orders by depth, 0xffffffff where culled
};

// One view, `camera` of upload_views' [V,32]; width and height in pixels. See cl/project.cl for what the parts hold.
Projected project(Context& ctx, const DeviceGaussians& gaussians, const Tensor& views, long view, int width,
                  int height);

}  // namespace vsplat

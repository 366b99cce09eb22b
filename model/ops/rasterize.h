// Blending of binned Gaussians, near to far; and its derivative.
#pragma once
#include <array>

#include "model/ops/tile_bin.h"

namespace vsplat {

struct DevicePicture {
  Tensor colour;  // f32 [H,W,3], over the background
  Tensor alpha;   // f32 [H,W]
  Tensor depth;   // f32 [H,W]: sum of weight x camera z
  // Of surfels alone, and each of them only where it is asked for:
  Tensor normal{};      // f32 [H,W,3]: sum of weight x normal, in the camera's axes, towards the camera
  Tensor median{};      // f32 [H,W]: the depth of the last that met a transmittance over 0.5; 0 where none did
  Tensor distortion{};  // f32 [H,W]: how far apart along the ray its weights are, see cl/rasterize_surfels.cl
  Tensor moments{};     // f32 [H,W,2]: what the derivative of the distortion needs beside it
};

// What a picture of surfels has beside colour, alpha and depth.
struct SurfelMaps {
  bool normal = false, median = false;
  bool distortion = false;  // with its moments
};

DevicePicture make_picture(Context& ctx, int width, int height, const SurfelMaps& maps = {});

// Draws a part of the picture.
struct RasterizeForward {
  Projected projected;
  Binned binned;
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // the part is written
};
void rasterize_forward(Context& ctx, const RasterizeForward& a);

// A loss's derivatives by a picture, of which any may be none: zeros.
struct PictureGradient {
  Tensor colour;  // f32 [H,W,3]
  Tensor alpha;   // f32 [H,W]
  Tensor depth;   // f32 [H,W]
  // Of surfels alone:
  Tensor normal{};      // f32 [H,W,3]
  Tensor distortion{};  // f32 [H,W]
};

// Instead of gradients how much each pixel by itself pulls at a Gaussian's place on the screen, summed whatever the
// direction: rows [N,2] of |dE/du| and |dE/dv|, with the Gaussian's shape held.
enum class Pulls {
  none,
  held,     // alpha held at 0.99 does not move
  through,  // it is taken to move as if it were not held
};

struct RasterizeBackward {
  Projected projected;
  Binned binned;  // with slots
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // as the forward made it
  PictureGradient dpicture;
  Pulls pulls = Pulls::none;
};
IntersectionGradients rasterize_backward(Context& ctx, const RasterizeBackward& a);

// Gaussians of a tile that a work-item of the cpu flavour looks at together.
constexpr long kRasterizeBatch = 64;
// Whether blending is that of the cpu flavour: the device must take vectors, too.
bool rasterizes_in_blocks(const Context& ctx);
// A kernel of the gpu flavour, in which a group owns a tile: as many items as the device lets it have, each with the
// fewest pixels, but no fewer than `least_pixels`. `bytes`: of local memory that a group of so many items takes.
struct TileKernel {
  const char *file, *name;
  std::string defines;
  long least_pixels;
  std::size_t (*bytes)(long group);
};
struct TileLaunch {
  KernelId id;
  long group;
};
TileLaunch tile_launch(const TileKernel& kernel, Context& ctx);
// Refuses a part that is not one of a picture of width x height pixels.
void check_part(const Part& part, long width, long height, const char* operation);

}  // namespace vsplat

// Blending of binned Gaussians, near to far; and its derivative.
#pragma once
#include <array>
#include <string>

#include "model/ops/render/tile_bin.h"
#include "runtime/shape_check.h"

namespace vsplat {

struct DevicePicture {
  Tensor colour;  // f32 [H,W,3], over the background
  Tensor alpha;   // f32 [H,W]
  Tensor depth;   // f32 [H,W]: sum of weight x camera z
  // Of surfels alone, and each of them only where it is asked for:
  Tensor normal{};      // f32 [H,W,3]: sum of weight x normal, in the camera's axes, towards the camera
  Tensor median{};      // f32 [H,W]: the depth of the last that met a transmittance over 0.5; 0 where none did
  Tensor distortion{};  // f32 [H,W]: how far apart along the ray its weights are, see cl/render/rasterize_surfels.cl
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

// What blending volumes and blending surfels (rasterize_surfels.h) have alike, forward and backward: what a work-item
// or a group takes of a picture, what they read, and the rows that they write.

// A kernel of either flavour of which one work-item (cpu) or one group (gpu) blends a tile.
struct TileKernel {
  const char *file, *cpu, *gpu;  // the file, and the names of the flavours' kernels
  std::string defines;           // of both, each beginning with a space
  long record;                   // floats of a Gaussian's record
  long columns = 0;              // backward: floats of a row of sums; 0: forward, which sums nothing
  double flops = 0;              // operations for a pixel and a Gaussian that it sees, which the kernel counts
  // cpu: how many of a tile's Gaussians are looked at together; gpu: pixels of an item, at the least. 0: the usual
  long batch = 0, pixels = 0;
};

struct TileLaunch {
  KernelId id;
  Range range;
};
// The flavour's kernel over `tiles` tiles. In the gpu flavour as many items a group as the device lets it have, each
// with the fewest pixels; Error(device) where it allows too few.
TileLaunch tile_launch(const TileKernel& kernel, Context& ctx, long tiles);
// Cost::most of it, where tiles have `n` Gaussians in all.
double most_blended(double n, double flops);

// Binds "V", "N", "H", "W" and "tiles + 1" by what both directions read, and maps of surfels where the picture has
// them. Refuses a part that is not one of the picture. `record`: as in TileKernel, in words.
void bind_blended(Dims& d, const Projected& projected, const Binned& binned, const Part& part,
                  const DevicePicture& picture, const char* record, const char* operation);
// Binds those gradients by a picture that there are, for a backward pass, and the slots that its rows go to.
void bind_gradient(Dims& d, const Binned& binned, const PictureGradient& dpicture);
// The rows of sums of N intersections, and their marks, which are zero.
IntersectionGradients make_rows(Context& ctx, long n, long columns);

}  // namespace vsplat

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
  // Only for surfels, and each only on request:
  Tensor normal{};      // f32 [H,W,3]: sum of weight x normal, in the camera's axes, towards the camera
  Tensor median{};      // f32 [H,W]: the depth of the last surfel that met a transmittance over 0.5; 0 if none did
  Tensor distortion{};  // f32 [H,W]: spread of its weights along the ray, see cl/render/rasterize_surfels.cl
  Tensor moments{};     // f32 [H,W,2]: sums for the derivative of the distortion
};

// The maps of a picture of surfels besides colour, alpha and depth.
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

// A loss's derivatives by a picture; any may be none: zeros.
struct PictureGradient {
  Tensor colour;  // f32 [H,W,3]
  Tensor alpha;   // f32 [H,W]
  Tensor depth;   // f32 [H,W]
  // Only for surfels:
  Tensor normal{};      // f32 [H,W,3]
  Tensor distortion{};  // f32 [H,W]
};

// Computes, instead of gradients, the magnitudes of each pixel's derivatives by a Gaussian's place on the screen,
// summed regardless of sign: rows [N,2] of |dE/du| and |dE/dv|, with the Gaussian's shape constant.
enum class Pulls {
  none,
  held,     // an alpha clamped to 0.99 has derivative 0
  through,  // it has the derivative of the unclamped alpha
};

struct RasterizeBackward {
  Projected projected;
  Binned binned;  // with slots
  Part part;
  std::array<float, 3> background = {};
  DevicePicture picture;  // from the forward
  PictureGradient dpicture;
  Pulls pulls = Pulls::none;
  // Whether dpicture.depth is a value of each pixel instead of a derivative by depth: the last column of the rows is
  // then the sum of weight x value, and nothing else depends on it. Without pulls.
  bool weigh = false;
};
IntersectionGradients rasterize_backward(Context& ctx, const RasterizeBackward& a);

// Shared by the blending of volumes and surfels (rasterize_surfels.h), forward and backward: a work-item's or group's
// share of a picture, the inputs, and the output rows.

// A kernel of both flavours, in which one work-item (cpu) or one group (gpu) blends a tile.
struct TileKernel {
  const char *file, *cpu, *gpu;  // the file, and the names of the flavours' kernels
  std::string defines;           // for both, each beginning with a space
  long record;                   // floats of a Gaussian's record
  long columns = 0;              // backward: floats of a row of sums; 0: forward, without sums
  double flops = 0;              // operations for a pixel and a Gaussian that it sees; the kernel counts such pairs
  // cpu: Gaussians of a tile that are processed together; gpu: least number of pixels of an item. 0: the default
  long batch = 0, pixels = 0;
};

struct TileLaunch {
  KernelId id;
  Range range;
};
// Launches the flavour's kernel over `tiles` tiles. In the gpu flavour with as many items a group as the device allows,
// each with the fewest pixels; Error(device) if it allows too few.
TileLaunch tile_launch(const TileKernel& kernel, Context& ctx, long tiles);
// Cost::most of blending, if tiles have `n` Gaussians in all.
double most_blended(double n, double flops);

// Binds "V", "N", "H", "W" and "tiles + 1" by the inputs of both directions, and the surfels' maps that the picture
// has. Rejects a part outside of the picture. `record`: as in TileKernel, as text.
void bind_blended(Dims& d, const Projected& projected, const Binned& binned, const Part& part,
                  const DevicePicture& picture, const char* record, const char* operation);
// Binds the gradients by a picture that are given, for a backward pass, and the slots of its rows.
void bind_gradient(Dims& d, const Binned& binned, const PictureGradient& dpicture);
// Allocates the rows of sums for N intersections, and their marks, which are zero.
IntersectionGradients make_rows(Context& ctx, long n, long columns);

}  // namespace vsplat

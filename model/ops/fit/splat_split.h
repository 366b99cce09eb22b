// Splits the Gaussians that cover a picture's errors, and scores them by that; see cl/fit/splat_split.cl.
#pragma once
#include <limits>

#include "model/ops/fit/splat_relocate.h"
#include "model/ops/render/rasterize.h"

namespace vsplat {

// The mean absolute difference over channels of pixels: colour f32 [H,W,3], clamped to [0, 1], and target f32 [H,W,3]
// -> error f32 [H,W].
void splat_error(Context& ctx, const Tensor& colour, const Tensor& target, const Tensor& error);

struct SplatScores {
  Projected visible;                    // N of them
  Tensor offsets;                       // u32 [N + 1]: from Binned
  IntersectionGradients intersections;  // of rasterize_backward() with `weigh`; the weighed column becomes 0
  Tensor scores;                        // f32 [K], for the whole scene: added to
  // A Gaussian that covers more pixels gets a score above all others.
  double most_pixels = std::numeric_limits<double>::infinity();
};
void splat_scores(Context& ctx, const SplatScores& a);

// scores += fresh, f32 [K]
void add_scores(Context& ctx, const Tensor& fresh, const Tensor& scores);

struct SplatSplit {
  SplatState all;    // of the whole capacity
  long count = 0;    // current number of Gaussians
  long grow_to = 0;  // wanted number of Gaussians, from `count` to the capacity
  Tensor scores;     // f32 [count], from 0 up
};
// Splits the Gaussians with the highest scores into two. The second halves take the places of those below an opacity of
// 0.005, then those behind the last Gaussian, until there are grow_to; a Gaussian is split once at most. The moments of
// both halves become zeros. Returns the new number of Gaussians. Waits for the device. Every run gives the same bits.
long splat_split(Context& ctx, const SplatSplit& a);

}  // namespace vsplat

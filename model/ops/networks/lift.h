// Samples feature maps at voxel centres, some voxels at a time, so that the samples of all views are never stored for
// the whole volume.
#pragma once
#include "model/base/device_cameras.h"
#include "model/ops/dense/scatter_rows.h"

namespace vsplat {

// The places of voxels [first, first + n) of the R^3 grid over [-0.5,0.5]^3 (x slowest) on each view's t x t map.
struct LiftCorners {
  DeviceCameras cameras;   // V of them
  int volume = 0;          // R
  int tokens = 0;          // t
  int image = 0;           // pixels along an edge
  bool half_pixel = true;  // half a pixel is added to a projection before it is sampled
  long first = 0;
  Tensor index;   // i32 [n, V, 4]: row of a map [V t t, C] for each of the four texels around the voxel's image
  Tensor weight;  // [n, V, 4]: bilinear; 0 for a texel outside the map
};
void lift_corners(Context& ctx, const LiftCorners& a);

// The biased variance of the V samples, channel by channel.
struct LiftVarianceForward {
  Tensor maps;           // [V t t, C]
  Tensor index, weight;  // [n, V, 4]
  Tensor out;            // [n, C]
};
void lift_variance_forward(Context& ctx, const LiftVarianceForward& a);

// The mean of the V samples, plus a bias, into rows first .. first + n of `out`.
struct LiftMeanForward {
  Tensor maps;           // [V t t, C]
  Tensor index, weight;  // [n, V, 4]
  Tensor bias;           // [C]
  long first = 0;
  Tensor out;  // [.., C]
};
void lift_mean_forward(Context& ctx, const LiftMeanForward& a);

// The V samples themselves, side by side.
struct LiftSamplesForward {
  Tensor maps;           // [V t t, C]
  Tensor index, weight;  // [n, V, 4]
  Tensor out;            // [n, V, C]
};
void lift_samples_forward(Context& ctx, const LiftSamplesForward& a);

// Gradients by the maps, for the same run of voxels: with `plan`, make_scatter_plan() of its index and weight for as
// many rows as the maps have.
struct LiftVarianceBackward {
  Tensor maps;           // [V t t, C]
  Tensor index, weight;  // [n, V, 4]
  const ScatterPlan* plan = nullptr;
  Tensor dout;   // [n, C]
  Tensor dmaps;  // [V t t, C], added to
};
// Uses scratch memory of n V C numbers.
void lift_variance_backward(Context& ctx, const LiftVarianceBackward& a);

struct LiftMeanBackward {
  long views = 0;  // V
  const ScatterPlan* plan = nullptr;
  Tensor dout;  // [.., C], of which rows first .. first + n are read
  long first = 0;
  Tensor dmaps;  // [V t t, C], added to
};
void lift_mean_backward(Context& ctx, const LiftMeanBackward& a);

struct LiftSamplesBackward {
  const ScatterPlan* plan = nullptr;
  Tensor dout;   // [n, V, C]
  Tensor dmaps;  // [V t t, C], added to
};
void lift_samples_backward(Context& ctx, const LiftSamplesBackward& a);

}  // namespace vsplat

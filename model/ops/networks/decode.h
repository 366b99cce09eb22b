// Decodes the heads' raw numbers to Gaussians. A = 3 + 3S + 1 + D + 4 numbers each: offset, SH, opacity, scale,
// rotation. D = 3, or 2 for surfels.
#pragma once
#include "model/base/gaussians.h"
#include "runtime/context.h"

namespace vsplat {

// Allocates `count` Gaussians with S = sh_count coefficients and D = scales.
DeviceGaussians make_gaussians(Context& ctx, long count, long sh_count, const std::string& what, long scales = 3);

// The properties in which the networks' coarse primitives differ.
struct CoarseKind {
  long each = 1;             // K, primitives of a voxel
  double reach = 0.25;       // largest distance of a primitive from its voxel's centre along each axis, in voxels
  bool exponential = false;  // a scale is exp(x + log(voxel / 3)), else softplus(x + log(exp(voxel / 6) - 1))
};

// K per voxel, near its centre, voxel by voxel.
struct DecodeCoarseForward {
  Tensor raw;           // [R^3, K A]
  long volume = 0;      // R
  DeviceGaussians out;  // K R^3
  CoarseKind kind = {};
};
void decode_coarse_forward(Context& ctx, const DecodeCoarseForward& a);

struct DecodeCoarseBackward {
  Tensor raw;              // [R^3, K A], as in the forward
  long volume = 0;         // R
  GaussianGradients dout;  // K R^3
  Tensor draw;             // [R^3, K A], not raw; written
  CoarseKind kind = {};
};
void decode_coarse_backward(Context& ctx, const DecodeCoarseBackward& a);

// M per selected voxel, within an eighth of a voxel of coarse centre + div_offset: Gaussian p M + m of `out`.
struct DecodeFineForward {
  Tensor raw;           // [P, M A]
  Tensor centres;       // [P, 3]
  Tensor div_offset;    // [M, 3]
  long volume = 0;      // R
  DeviceGaussians out;  // at least P M; the first are written
};
void decode_fine_forward(Context& ctx, const DecodeFineForward& a);

struct DecodeFineBackward {
  Tensor raw;              // [P, M A], as in the forward
  long volume = 0;         // R
  GaussianGradients dout;  // at least P M; the first are read
  Tensor draw;             // [P, M A], not raw; written
  Tensor dcentres;         // [P, 3], added to
};
void decode_fine_backward(Context& ctx, const DecodeFineBackward& a);

// One Gaussian for each of P points, its mean; a scale is exp(x + log(unit)).
struct DecodePointsForward {
  Tensor raw;       // [P, A - 3]: no offset
  Tensor points;    // [P, 3]
  double unit = 1;  // the scale for a raw value of 0
  long row0 = 0;    // Gaussians row0 .. row0 + P - 1 of `out` are written
  DeviceGaussians out;
};
void decode_points_forward(Context& ctx, const DecodePointsForward& a);

struct DecodePointsBackward {
  Tensor raw;  // [P, A - 3], as in the forward
  double unit = 1;
  long row0 = 0;  // Gaussians row0 .. row0 + P - 1 are read
  GaussianGradients dout;
  Tensor draw;     // [P, A - 3], not raw; written
  Tensor dpoints;  // [P, 3], written
};
void decode_points_backward(Context& ctx, const DecodePointsBackward& a);

// The skeleton with new SH and opacity = sigmoid(factor) * its opacity; the rest is copied.
struct DecodeAdjustedForward {
  Tensor raw;                // [P, 3S + 1]: SH, factor
  DeviceGaussians skeleton;  // P
  long row0 = 0;
  DeviceGaussians out;  // Gaussians row0 .. row0 + P - 1 are written
};
void decode_adjusted_forward(Context& ctx, const DecodeAdjustedForward& a);

struct DecodeAdjustedBackward {
  Tensor raw;        // [P, 3S + 1], as in the forward
  Tensor opacities;  // [P]: the skeleton's
  long row0 = 0;
  GaussianGradients dout;       // Gaussians row0 .. row0 + P - 1 are read
  Tensor draw;                  // [P, 3S + 1], not raw; written
  GaussianGradients dskeleton;  // P, added to; its SH may be none, since nothing depends on them
};
void decode_adjusted_backward(Context& ctx, const DecodeAdjustedBackward& a);

}  // namespace vsplat

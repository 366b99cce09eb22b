// K Gaussians, on the host and on the device. Means and scales (standard deviations) are in the frame's units,
// quaternions are unit and ordered w x y z, opacities are in [0,1], and spherical harmonics have S = (degree + 1)^2
// coefficients with colour = max(0, basis . sh + 0.5). All Gaussians of a scene have the same kind, which determines D,
// the number of scales of each.
#pragma once
#include <cstddef>
#include <vector>

#include "runtime/tensor.h"

namespace vsplat {

// A volume has three axes and three scales. A surfel is flat: its first two axes are tangents with a scale each, and
// its third axis is the normal.
enum class GaussianKind { volume, surfel };
inline int scales_of(GaussianKind kind) { return kind == GaussianKind::surfel ? 2 : 3; }

// Coefficients of higher degrees are kept in memory and in files, but not drawn.
inline constexpr int kDrawnDegree = 3;

struct Gaussians {
  std::size_t count = 0;
  int sh_degree = 0;             // 0 to 4
  std::vector<float> means;      // [K,3]
  std::vector<float> scales;     // [K,D]
  std::vector<float> quats;      // [K,4]
  std::vector<float> opacities;  // [K]
  std::vector<float> sh;         // [K,S,3]
  GaussianKind kind = GaussianKind::volume;

  std::size_t sh_count() const { return static_cast<std::size_t>(sh_degree + 1) * (sh_degree + 1); }
  int drawn_degree() const { return sh_degree < kDrawnDegree ? sh_degree : kDrawnDegree; }
  std::size_t drawn_sh_count() const { return static_cast<std::size_t>(drawn_degree() + 1) * (drawn_degree() + 1); }
};

struct DeviceGaussians {
  Tensor means;      // f32 [K,3]
  Tensor scales;     // f32 [K,D]
  Tensor quats;      // f32 [K,4]
  Tensor opacities;  // f32 [K]
  Tensor sh;         // f32 [K,S,3]

  long count() const { return means ? means.dim(0) : 0; }
  int sh_degree() const;
  GaussianKind kind() const;  // derived from D
};

// Derivatives of a loss with respect to the Gaussians, in the same shapes.
struct GaussianGradients {
  Tensor means;      // f32 [K,3]
  Tensor scales;     // f32 [K,D]
  Tensor quats;      // f32 [K,4], with respect to the quaternions before normalisation
  Tensor opacities;  // f32 [K]
  Tensor sh;         // f32 [K,S,3]
};

class Context;
// Zero gradients for `count` Gaussians.
GaussianGradients zero_gradients(Context& ctx, long count, int sh_degree, GaussianKind kind = GaussianKind::volume);
Gaussians download(Context& ctx, const DeviceGaussians& g);
// Spherical harmonics are uploaded up to kDrawnDegree.
DeviceGaussians upload(Context& ctx, const Gaussians& g);
// Uploads `n` Gaussians from `first` on.
DeviceGaussians upload(Context& ctx, const Gaussians& g, long first, long n);

}  // namespace vsplat

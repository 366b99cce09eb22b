// What a fit draws and measures pictures over: what is behind the Gaussians where transmittance is left.
#pragma once
#include <array>
#include <string>

#include "model/fit/fit_checkpoint.h"
#include "model/fit/fit_picture.h"
#include "model/ops/render/rasterize.h"

namespace vsplat {

struct FitBackground {
  enum class Kind {
    automatic,  // white; masked pictures in every other step over a random colour
    colour,
    random,  // another colour in every step; measured over black
    sky      // a Sky that is learnt
  };
  Kind kind = Kind::automatic;
  std::array<float, 3> colour{1, 1, 1};  // for `colour`
};

// The colour that pictures are measured over. A sky is drawn over black.
std::array<float, 3> measured_over(const FitBackground& background);
// The colour of a step.
std::array<float, 3> drawn_over(const FitBackground& background, bool masked, std::uint64_t seed, std::uint32_t step);

// A sphere of Gaussians that shows a sky from near its centre.
struct SkySphere {
  std::array<double, 3> centre{};
  double radius = 100;
};
inline constexpr long kSkyGaussians = 10000;

// Spherical harmonics of degree 4 over directions (cl/fit/sky_background.cl), at first mid grey, with their optimiser.
class Sky {
 public:
  explicit Sky(Context& ctx);

  // `camera` as upload_views() makes it. Returns the colours over the sky, f32 [H,W,3], of a picture over black.
  Tensor shown(Context& ctx, const DevicePicture& drawn, const Tensor& camera) const;
  // `by`: the loss's gradient by what shown() returned, which is also that by the drawn colour; its alpha is added to.
  // Overwrites the sky's own gradient. The pose's gradient does not contain how the sky turns with the camera.
  void differentiate(Context& ctx, const DevicePicture& drawn, const Tensor& camera, const PictureGradient& by) const;
  // Applies the gradient; `step` counts from 1.
  void move(Context& ctx, long step) const;

  // Round Gaussians of constant colour, which cover the sphere without gaps: together they are nearly opaque.
  Gaussians gaussians(Context& ctx, const SkySphere& sphere, int sh_degree) const;

  void put(Context& ctx, FitTensors& out) const;
  void get(Context& ctx, const FitTensors& from) const;

 private:
  Tensor sh_, gradient_, m_, v_;  // f32 [1,75]
};

}  // namespace vsplat

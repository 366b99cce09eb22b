// LaRa's adaptive layer norm: like VS-Splat's PoseModulation, but with SiLU on the rays and a single Linear.
#pragma once
#include "model/base/device_cameras.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/lara_layers.h"

namespace vsplat {

class LaraModulation {
 public:
  // Loads "dir_norm.*".
  LaraModulation(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  struct Saved {
    Tensor tokens;  // the input
    Tensor rays;    // [V t t, 32]
    Tensor film;    // [V, t t, 2 C]
  };
  // tokens [V, 1 + t t, C], whose class token is dropped -> features [V, t, t, C]: LayerNorm(x) (1 + scale) + shift,
  // (shift, scale) = Linear(SiLU(spherical harmonics of the ray's direction and moment)).
  Tensor forward(Context& ctx, const Tensor& tokens, const DeviceCameras& cameras, Saved* saved = nullptr) const;
  // dfeatures [V, t, t, C] -> gradient by the tokens, [V, 1 + t t, C]. Adds to the gradients of the weights.
  Tensor backward(Context& ctx, const Saved& saved, const Tensor& dfeatures) const;

 private:
  LaraConfig config_;
  LaraModulationLayers<WeightLoader> layers_;
};

}  // namespace vsplat

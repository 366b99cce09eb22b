// Pose modulation: an adaptive layer norm that tells every token which ray it saw.
#pragma once
#include "model/base/device_cameras.h"
#include "model/network/upload_weights.h"
#include "model/params/config.h"

namespace vsplat {

class PoseModulation {
 public:
  // Takes "dir_norm.*".
  PoseModulation(Context& ctx, const Config& config, const WeightSource& weights);

  // What the backward wants of a forward.
  struct Saved {
    Tensor tokens;  // as they came
    Tensor rays;    // [V t t, 32]
    Tensor hidden;  // [V t t, C], before SiLU
    Tensor film;    // [V, t t, 2 C]
  };

  // tokens [V, 1 + t t, C] with the class token, which is dropped -> features [V, t, t, C]:
  // LayerNorm(x) (1 + scale) + shift, (shift, scale) = MLP(spherical harmonics of the ray's direction and moment).
  Tensor forward(Context& ctx, const Tensor& tokens, const DeviceCameras& cameras, Saved* saved = nullptr) const;
  // dfeatures [V, t, t, C], by forward's result -> by the tokens, [V, 1 + t t, C], zeros by the class tokens. Adds to
  // the gradients by the weights. Of the cameras there is none.
  Tensor backward(Context& ctx, const Saved& saved, const Tensor& dfeatures) const;

 private:
  Config config_;
  ModulationLayers<WeightLoader> layers_;
};

}  // namespace vsplat

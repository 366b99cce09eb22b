// Pose modulation: an adaptive layer norm that conditions every token on its ray.
#pragma once
#include "model/base/device_cameras.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"

namespace vsplat {

class PoseModulation {
 public:
  // Loads "dir_norm.*".
  PoseModulation(Context& ctx, const Config& config, const WeightSource& weights);

  // What backward needs from a forward.
  struct Saved {
    Tensor tokens;     // input
    Tensor predicted;  // input
    Tensor rays;       // [V t t, 32]
    Tensor hidden;     // [V t t, C], before SiLU
    Tensor film;       // [V, t t, 2 C]
  };

  // tokens [V, P + t t, C], whose first P tokens are not patches and are dropped -> features [V, t, t, C]: LayerNorm(x)
  // (1 + scale) + shift, (shift, scale) = MLP(spherical harmonics of the ray's direction and moment). `predicted` [V,
  // t, t, 6], if given, replaces the cameras' rays.
  Tensor forward(Context& ctx, const Tensor& tokens, const DeviceCameras& cameras, Saved* saved = nullptr,
                 const Tensor& predicted = {}) const;
  // dfeatures [V, t, t, C], by forward's result -> gradient by the tokens, [V, P + t t, C], with zeros for the first P.
  // Adds to the gradients of the weights. There is no gradient by the cameras. Adds to drays [V, t, t, 6], by the
  // predicted rays.
  Tensor backward(Context& ctx, const Saved& saved, const Tensor& dfeatures, const Tensor& drays = {}) const;

 private:
  Config config_;
  ModulationLayers<WeightLoader> layers_;
};

}  // namespace vsplat

// Pose modulation: an adaptive layer norm that tells every token which ray it saw.
#pragma once
#include "model/base/device_cameras.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"

namespace vsplat {

class PoseModulation {
 public:
  // Takes "dir_norm.*".
  PoseModulation(Context& ctx, const Config& config, const WeightSource& weights);

  // What the backward wants of a forward.
  struct Saved {
    Tensor tokens;     // as they came
    Tensor predicted;  // likewise
    Tensor rays;       // [V t t, 32]
    Tensor hidden;     // [V t t, C], before SiLU
    Tensor film;       // [V, t t, 2 C]
  };

  // tokens [V, P + t t, C] with the P that are no patches, which are dropped -> features [V, t, t, C]:
  // LayerNorm(x) (1 + scale) + shift, (shift, scale) = MLP(spherical harmonics of the ray's direction and moment).
  // `predicted` [V, t, t, 6] stand for the cameras' rays, where they are there.
  Tensor forward(Context& ctx, const Tensor& tokens, const DeviceCameras& cameras, Saved* saved = nullptr,
                 const Tensor& predicted = {}) const;
  // dfeatures [V, t, t, C], by forward's result -> by the tokens, [V, P + t t, C], zeros by the first P. Adds to
  // the gradients by the weights. Of the cameras there is none.
  // drays [V, t, t, 6], by predicted rays, is added to.
  Tensor backward(Context& ctx, const Saved& saved, const Tensor& dfeatures, const Tensor& drays = {}) const;

 private:
  Config config_;
  ModulationLayers<WeightLoader> layers_;
};

}  // namespace vsplat

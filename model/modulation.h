// Pose modulation: an adaptive layer norm that tells every token which ray it saw.
#pragma once
#include "model/config.h"
#include "model/device_cameras.h"
#include "model/upload_weights.h"
#include "runtime/gemm.h"

namespace vsplat {

class PoseModulation {
 public:
  // Takes "dir_norm.*".
  PoseModulation(Context& ctx, const Config& config, const WeightSource& weights);

  // tokens [V, 1 + t t, C] with the class token, which is dropped -> features [V, t, t, C]:
  // LayerNorm(x) (1 + scale) + shift, (shift, scale) = MLP(spherical harmonics of the ray's direction and moment).
  Tensor forward(Context& ctx, const Tensor& tokens, const DeviceCameras& cameras) const;

 private:
  Config config_;
  Tensor gamma_, beta_, bias0_, bias1_;
  PackedMatrix weight0_, weight1_;
};

}  // namespace vsplat

// Lifting fused with the 1x1x1 convolution after it, so that neither the views' volumes nor the 2C channels of mean and
// variance are ever stored. Sampling and the mean are linear: the mean half of the convolution is applied to the maps,
// whose samples are then averaged. Only the variance half needs C channels per voxel, for a block of voxels at a time.
#pragma once
#include "model/base/device_cameras.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"
#include "runtime/gemm.h"

namespace vsplat {

class Lifting {
 public:
  // Loads "volume_network.conv_in.0.*".
  Lifting(Context& ctx, const Config& config, const WeightSource& weights);

  struct Saved {
    Tensor features;
    DeviceCameras cameras;
  };
  // features [V, t, t, C] -> [R^3, 4 C~], x slowest: the convolution of (mean, biased variance) over the views.
  Tensor forward(Context& ctx, const Tensor& features, const DeviceCameras& cameras, Saved* saved = nullptr) const;
  // dout [R^3, 4 C~] -> dfeatures [V, t, t, C], which is added to. Recomputes the variance, a block of voxels at a
  // time.
  void backward(Context& ctx, const Saved& saved, const Tensor& dout, const Tensor& dfeatures) const;

 private:
  Config config_;
  LiftingLayers<WeightLoader> layers_;
};

}  // namespace vsplat

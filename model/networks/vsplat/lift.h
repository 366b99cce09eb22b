// Lifting with the 1x1x1 convolution that follows it, so that neither the views' volumes nor the 2C channels of mean
// and variance ever exist. Sampling and the mean are linear: the convolution's mean half is applied to the maps, whose
// samples are then averaged. Only the variance half needs C channels per voxel, a block of voxels at a time.
#pragma once
#include "model/base/device_cameras.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"
#include "runtime/gemm.h"

namespace vsplat {

class Lifting {
 public:
  // Takes "volume_network.conv_in.0.*".
  Lifting(Context& ctx, const Config& config, const WeightSource& weights);

  struct Saved {
    Tensor features;
    DeviceCameras cameras;
  };
  // features [V, t, t, C] -> [R^3, 4 C~], x slowest: the convolution of (mean, biased variance) over the views.
  Tensor forward(Context& ctx, const Tensor& features, const DeviceCameras& cameras, Saved* saved = nullptr) const;
  // dout [R^3, 4 C~] -> dfeatures [V, t, t, C], added to. The variance is computed again, a block of voxels at a time.
  void backward(Context& ctx, const Saved& saved, const Tensor& dout, const Tensor& dfeatures) const;

 private:
  Config config_;
  LiftingLayers<WeightLoader> layers_;
};

}  // namespace vsplat

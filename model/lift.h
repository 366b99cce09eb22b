// Lifting with the 1x1x1 convolution that follows it, so that neither the views' volumes nor the 2C channels of mean
// and variance ever exist. Sampling and the mean are linear: the convolution's mean half is applied to the maps, whose
// samples are then averaged. Only the variance half needs C channels per voxel, a block of voxels at a time.
#pragma once
#include "model/config.h"
#include "model/device_cameras.h"
#include "model/upload_weights.h"
#include "runtime/gemm.h"

namespace vsplat {

class Lifting {
 public:
  // Takes "volume_network.conv_in.0.*".
  Lifting(Context& ctx, const Config& config, const WeightSource& weights);

  // features [V, t, t, C] -> [R^3, 4 C~], x slowest: the convolution of (mean, biased variance) over the views.
  Tensor forward(Context& ctx, const Tensor& features, const DeviceCameras& cameras) const;

 private:
  Config config_;
  PackedMatrix mean_, variance_;  // [C, 4 C~] each
  Tensor bias_;
};

}  // namespace vsplat

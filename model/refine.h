// The fine stage's features: what the views see at the coarse centres (PAP), refined by a sparse network over the
// selected voxels (SFR).
#pragma once
#include <vector>

#include "model/config.h"
#include "model/device_cameras.h"
#include "model/layers.h"

namespace vsplat {

class Refinement {
 public:
  // Takes "voxel_network.*".
  Refinement(Context& ctx, const Config& config, const WeightSource& weights);

  struct Input {
    Tensor volume;    // [R^3, C~], the volume network's
    Tensor features;  // [V, t, t, C]
    const DeviceCameras* cameras = nullptr;
    Tensor means;  // [P, 3], the coarse centres of the selected voxels
    Tensor index;  // i32 [P], the selected voxels
  };
  struct Output {
    Tensor projected;  // [P, C]; none where the configuration does not use it
    Tensor refined;    // [P, fine_dim]
  };
  Output forward(Context& ctx, const Input& in) const;

 private:
  // norm-SiLU-conv, norm-SiLU-conv, plus x.
  struct ResBlock {
    GroupNorm norm1, norm2;
    Conv conv1, conv2;
  };

  Config config_;
  Linear comp_linear_;
  Conv conv_in_, conv_out_;
  std::vector<ResBlock> blocks_;
  GroupNorm norm_out_;
};

}  // namespace vsplat

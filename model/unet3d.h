// The dense volume network: the second half of the compressor and the light 3D U-Net.
#pragma once
#include <vector>

#include "model/config.h"
#include "model/layers.h"

namespace vsplat {

class VolumeNetwork {
 public:
  // Takes "volume_network.*" but its first convolution, which lifting has (see model/lift.h).
  VolumeNetwork(Context& ctx, const Config& config, const WeightSource& weights);

  // volume [R^3, 4 C~], x slowest: what the first 1x1x1 convolution made; its memory goes back as soon as it has been
  // read, if the caller keeps no other handle. -> [R^3, C~]
  Tensor forward(Context& ctx, Tensor volume) const;

 private:
  // norm-SiLU-conv, norm-SiLU-conv, plus x or a 1x1x1 of x.
  struct ResBlock {
    GroupNorm norm1, norm2;
    Conv conv1, conv2;
    Linear shortcut;  // nin_shortcut; none where the width stays
  };
  struct Down {
    ResBlock res;
    Conv downsample;  // none at the last level
  };
  struct Up {
    ResBlock res[2];
  };

  ResBlock load_res(const WeightLoader& weights, const std::string& name, long in, long out) const;
  // Of [x0, x1] at edge^3 voxels.
  Tensor res(Context& ctx, const ResBlock& block, Tensor x0, Tensor x1, long edge) const;

  Config config_;
  GroupNorm norm_in_, norm_out_;
  Conv conv_in_, conv_out_;
  std::vector<Down> down_;
  ResBlock mid_;
  std::vector<Up> up_;
};

}  // namespace vsplat

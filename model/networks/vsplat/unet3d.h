// The dense volume network: the second half of the compressor and the light 3D U-Net.
#pragma once
#include <utility>
#include <vector>

#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"

namespace vsplat {

class VolumeNetwork {
 public:
  // Takes "volume_network.*" but its first convolution, which lifting has (see model/networks/vsplat/lift.h).
  VolumeNetwork(Context& ctx, const Config& config, const WeightSource& weights);

  // A res block's inputs, and what its first convolution made, each with its norm's statistics.
  struct ResSaved {
    NormSaved norm1, norm2;
  };
  struct Saved {
    NormSaved norm_in, norm_out;
    std::vector<ResSaved> down, up;   // as the forward came by
    std::vector<Tensor> downsampled;  // what each downsampling was given
    ResSaved mid;
  };

  // volume [R^3, 4 C~], x slowest: what the first 1x1x1 convolution made; its memory goes back as soon as it has been
  // read, if neither the caller nor `saved` keeps it. -> [R^3, C~]
  Tensor forward(Context& ctx, Tensor volume, Saved* saved = nullptr) const;
  // dout [R^3, C~] -> by the volume [R^3, 4 C~]. Gives back what is saved as it goes, if the caller keeps no copy.
  Tensor backward(Context& ctx, Saved saved, Tensor dout) const;

 private:
  using ResBlock = VolumeResBlock<WeightLoader>;

  // Of [x0, x1] at edge^3 voxels.
  Tensor res(Context& ctx, const ResBlock& block, Tensor x0, Tensor x1, long edge, ResSaved* saved) const;
  // dy, which is written over -> by x0, and by x1 where there was one.
  std::pair<Tensor, Tensor> res_backward(Context& ctx, const ResBlock& block, ResSaved saved, Tensor dy,
                                         long edge) const;

  Config config_;
  VolumeLayers<WeightLoader> layers_;
};

}  // namespace vsplat

// The dense volume network: the second half of the compressor and the light 3D U-Net.
#pragma once
#include <utility>
#include <vector>

#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"

namespace vsplat {

class VolumeNetwork {
 public:
  // Loads "volume_network.*" except for its first convolution, which lifting applies (see
  // model/networks/vsplat/fused_lift.h).
  VolumeNetwork(Context& ctx, const Config& config, const WeightSource& weights);

  // A residual block's inputs and the output of its first convolution, each with its norm's statistics.
  struct ResSaved {
    NormSaved norm1, norm2;
  };
  struct Saved {
    NormSaved norm_in, norm_out;
    std::vector<ResSaved> down, up;   // in the forward's order
    std::vector<Tensor> downsampled;  // input of each downsampling
    ResSaved mid;
  };

  // volume [R^3, 4 C~], x slowest: the output of the first 1x1x1 convolution. Its memory is freed as soon as it has
  // been read, unless the caller or `saved` holds it. -> [R^3, C~]
  Tensor forward(Context& ctx, Tensor volume, Saved* saved = nullptr) const;
  // dout [R^3, C~] -> gradient by the volume [R^3, 4 C~]. Frees the saved tensors as it goes, unless the caller holds a
  // copy.
  Tensor backward(Context& ctx, Saved saved, Tensor dout) const;

 private:
  using ResBlock = VolumeResBlock<WeightLoader>;

  // Applies a residual block to [x0, x1] at edge^3 voxels.
  Tensor res(Context& ctx, const ResBlock& block, Tensor x0, Tensor x1, long edge, ResSaved* saved) const;
  // dy, which is overwritten -> gradients by x0, and by x1 if there was one.
  std::pair<Tensor, Tensor> res_backward(Context& ctx, const ResBlock& block, ResSaved saved, Tensor dy,
                                         long edge) const;

  Config config_;
  VolumeLayers<WeightLoader> layers_;
};

}  // namespace vsplat

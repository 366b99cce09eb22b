// Features of the fine stage: projected features of the views at the coarse centres (PAP), refined by a sparse network
// over the selected voxels (SFR).
#pragma once
#include <vector>

#include "model/base/device_cameras.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"

namespace vsplat {

class Refinement {
 public:
  // Loads "voxel_network.*".
  Refinement(Context& ctx, const Config& config, const WeightSource& weights);

  struct Input {
    Tensor volume;    // [R^3, C~], result of the volume network
    Tensor features;  // [V, t, t, C]
    const DeviceCameras* cameras = nullptr;
    Tensor means;  // [P, 3], the coarse centres of the selected voxels
    Tensor index;  // i32 [P], the selected voxels
  };
  struct Output {
    Tensor projected;  // [P, C]; empty if the configuration does not use it
    Tensor refined;    // [P, fine_dim]
  };

  // What backward needs from a forward: some ten tensors [P, voxel_ch], and [P, C].
  struct Saved {
    Tensor features, means, index;  // input
    DeviceCameras cameras;
    Tensor volume_position;  // [P, C~ + 63]
    Tensor projected;        // [P, C] or empty
    Tensor map;              // i32 [P, 27]
    Tensor linear;           // [P, voxel_ch], result of comp_linear
    struct Block {
      NormSaved norm1, norm2;
    };
    std::vector<Block> blocks;
    NormSaved norm_out;
  };
  // `saved`: for the backward, or null.
  Output forward(Context& ctx, const Input& in, Saved* saved = nullptr) const;

  // All are added to.
  struct Gradients {
    Tensor volume;    // [R^3, C~]
    Tensor features;  // [V, t, t, C]; unused if the configuration does not use the projected features
    Tensor means;     // [P, 3]
  };
  // drefined [P, fine_dim], by the refined features -> gradients by the inputs. Adds to the gradients of the weights,
  // which are LearntWeights.
  void backward(Context& ctx, const Saved& saved, const Tensor& drefined, const Gradients& out) const;

 private:
  Config config_;
  RefinementLayers<WeightLoader> layers_;
};

}  // namespace vsplat

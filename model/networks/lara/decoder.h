// LaRa's decoders: from a voxel's feature to K primitives, and from the input views at a kept primitive's position to
// its colours.
#pragma once
#include <vector>

#include "model/base/device_cameras.h"
#include "model/base/gaussians.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/lara_layers.h"

namespace vsplat {

class LaraCoarseDecoder {
 public:
  // Loads "decoder.mlp_coarse.*".
  LaraCoarseDecoder(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  struct Saved {
    std::vector<Tensor> mlp;  // input of each layer
    Tensor raw;               // [N, K A]
  };
  // volume [N, C], N = (2R)^3 -> N K primitives, voxel by voxel.
  DeviceGaussians forward(Context& ctx, const Tensor& volume, Saved* saved = nullptr) const;
  // Takes the gradients by the primitives; adds the gradient by the volume to dvolume.
  void backward(Context& ctx, const Saved& saved, const GaussianGradients& dgaussians, const Tensor& dvolume) const;

 private:
  LaraConfig config_;
  LaraCoarseLayers<WeightLoader> layers_;
};

class LaraFineDecoder {
 public:
  // Loads "decoder.norm.*", "decoder.cross_att.*" and "decoder.mlp_fine.*".
  LaraFineDecoder(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  struct Input {
    Tensor volume;          // [N, C]
    Tensor means;           // [P, 3], the kept primitives
    std::vector<int> kept;  // indices of the P kept primitives, ascending; primitive / K is the voxel
    Tensor maps;            // [V, S, S, 8], see model/ops/networks/view_maps.h
    DeviceCameras cameras;
    long block = 16384;  // primitives processed at a time: keys and values of all would take gigabytes
  };
  // -> [P, F + 3 S]: F features, then the values added to the colours.
  Tensor forward(Context& ctx, const Input& in) const;
  // -> [P, V, 8]: samples of the views at each position, for all primitives at once.
  Tensor samples(Context& ctx, const Input& in) const;

  // All are added to. Any but the first may be empty if it is not needed.
  struct Gradients {
    Tensor volume;  // [N, C]
    Tensor means;   // [N K, 3], by the coarse primitives' means
    Tensor maps;    // [V, S, S, 8]
  };
  // dout [P, F + 3 S]. Recomputes the forward, a block at a time.
  void backward(Context& ctx, const Input& in, const Tensor& dout, const Gradients& out) const;

 private:
  // Intermediate values of the primitives first .. first + n - 1.
  struct Block {
    long first, n;
    Tensor index;                            // i32 [n]
    Tensor points;                           // [n, 3]
    Tensor feature, samples;                 // [n, C], [n, V, 8]
    Tensor q, k, v, attended, stats, mixed;  // mixed: after the attention's last Linear
    Tensor hidden;                           // [n, fine_hidden], after ReLU
  };
  Block run(Context& ctx, const Input& in, long first, long n, bool keep) const;
  void backward(Context& ctx, const Input& in, const Block& block, const Tensor& dout, const Gradients& out) const;

  LaraConfig config_;
  LaraFineLayers<WeightLoader> layers_;
};

}  // namespace vsplat

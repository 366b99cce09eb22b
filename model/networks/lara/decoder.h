// LaRa's decoders: a voxel's feature to K primitives; and the colours of those that are kept, from what the input views
// show at their places.
#pragma once
#include <vector>

#include "model/base/device_cameras.h"
#include "model/base/gaussians.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/lara_layers.h"

namespace vsplat {

class LaraCoarseDecoder {
 public:
  // Takes "decoder.mlp_coarse.*".
  LaraCoarseDecoder(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  struct Saved {
    std::vector<Tensor> mlp;  // what each layer was given
    Tensor raw;               // [N, K A]
  };
  // volume [N, C], N = (2R)^3 -> N K primitives, voxel by voxel.
  DeviceGaussians forward(Context& ctx, const Tensor& volume, Saved* saved = nullptr) const;
  // By the primitives to that by the volume, which is added to.
  void backward(Context& ctx, const Saved& saved, const GaussianGradients& dgaussians, const Tensor& dvolume) const;

 private:
  LaraConfig config_;
  LaraCoarseLayers<WeightLoader> layers_;
};

class LaraFineDecoder {
 public:
  // Takes "decoder.norm.*", "decoder.cross_att.*" and "decoder.mlp_fine.*".
  LaraFineDecoder(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  struct Input {
    Tensor volume;          // [N, C]
    Tensor means;           // [P, 3], of the kept primitives
    std::vector<int> kept;  // P of them: primitive / K is the voxel; ascending
    Tensor maps;            // [V, S, S, 8], see model/ops/networks/view_maps.h
    DeviceCameras cameras;
    long block = 16384;  // how many primitives come at a time: keys and values of all would be gigabytes
  };
  // -> [P, F + 3 S]: F features, then what is added to the colours.
  Tensor forward(Context& ctx, const Input& in) const;
  // -> [P, V, 8]: what the views show at each one's place, of all of them at once.
  Tensor samples(Context& ctx, const Input& in) const;

  // All added to, and each may be none where it is not wanted but the first.
  struct Gradients {
    Tensor volume;  // [N, C]
    Tensor means;   // [N K, 3], by the coarse primitives
    Tensor maps;    // [V, S, S, 8]
  };
  // dout [P, F + 3 S]. Makes what it wants of the forward again, a block at a time.
  void backward(Context& ctx, const Input& in, const Tensor& dout, const Gradients& out) const;

 private:
  // What the primitives first .. first + n - 1 went through.
  struct Block {
    long first, n;
    Tensor index;                            // i32 [n]
    Tensor points;                           // [n, 3]
    Tensor feature, samples;                 // [n, C], [n, V, 8]
    Tensor q, k, v, attended, stats, mixed;  // mixed: behind the attention's last Linear
    Tensor hidden;                           // [n, fine_hidden], behind ReLU
  };
  Block run(Context& ctx, const Input& in, long first, long n, bool keep) const;
  void backward(Context& ctx, const Input& in, const Block& block, const Tensor& dout, const Gradients& out) const;

  LaraConfig config_;
  LaraFineLayers<WeightLoader> layers_;
};

}  // namespace vsplat

// LaRa's volume transformer: a learned volume, shared by all objects, whose cells attend to the features lifted to
// them.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/networks/layers/checkpointed.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/lara_layers.h"
#include "model/ops/dense/cross_attention.h"

namespace vsplat {

// Attention groups in an n^3 grid of cells: the voxels of the R^3 volume in a cell attend to the voxels of the r^3 grid
// in the same cell, in every view. Rows are voxels, x slowest; the lifted grid has V rows a voxel, one per view.
AttentionGroups window_groups(Context& ctx, long volume, long lifted, long views, long cells);

class LaraVolume {
 public:
  // Loads "vol_decoder.*".
  LaraVolume(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  // What a layer's backward needs from its forward; norms and GELU are recomputed.
  struct LayerSaved {
    Tensor x;                      // [R^3, C], the layer's input
    Tensor q, k, v;                // [R^3, C], [r^3 V, C]
    Tensor attended, stats;        // [R^3, C], see model/ops/dense/cross_attention.h
    Tensor middle, hidden, after;  // after the attention; in the MLP before GELU; after the MLP
  };
  struct Saved {
    explicit Saved(bool recompute) : recomputes(recompute) {}

    bool recomputes;  // store only the layers' inputs and run each layer again before its backward
    RowSource lifted;
    long views = 0;
    std::vector<Checkpointed<LayerSaved>> layers;
    Tensor last;  // [R^3, C], before the final norm
  };
  // Called with a layer's results under their golden names ("layer.0.attention"); may be empty.
  using Tap = std::function<void(const std::string&, const Tensor&)>;

  // lifted: rows [r^3 V, C'] from LaraLifting -> [(2R)^3, out_ch]
  Tensor forward(Context& ctx, const RowSource& lifted, long views, Saved* saved = nullptr, const Tap& tap = {}) const;

  struct Gradients {
    Tensor samples, embedded;  // by the two sources of the lifted rows
  };
  // dout [(2R)^3, out_ch]. Adds to the gradients of the weights, including the initial volume.
  Gradients backward(Context& ctx, Saved saved, const Tensor& dout) const;

 private:
  using Layer = LaraVolumeLayers<WeightLoader>::Layer;
  Tensor forward(Context& ctx, const Layer& layer, const Tensor& x, const RowSource& lifted,
                 const AttentionGroups& groups, LayerSaved* saved, const std::string& name, const Tap& tap) const;
  // dy: gradient by the layer's output -> by its input. Adds to `out`.
  Tensor backward(Context& ctx, const Layer& layer, const LayerSaved& saved, const RowSource& lifted,
                  const AttentionGroups& groups, const Tensor& dy, const Gradients& out) const;
  // One per entry of `windows`.
  std::vector<AttentionGroups> all_groups(Context& ctx, long views) const;

  LaraConfig config_;
  LaraVolumeLayers<WeightLoader> layers_;
  Tensor start_;  // [R^3, C]: stored channels first
};

}  // namespace vsplat

// LaRa's volume transformer: a learned volume, the same for every object, whose cells look at what was lifted to them.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/networks/layers/kept.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/lara_layers.h"
#include "model/ops/dense/cross_attention.h"

namespace vsplat {

// Who looks at whom in an n^3 grid of cells: the voxels of a cell of the R^3 volume at those of the r^3 grid in it, of
// every view. Rows are voxels, x slowest; of the lifted grid a voxel's V views are V rows.
AttentionGroups window_groups(Context& ctx, long volume, long lifted, long views, long cells);

class LaraVolume {
 public:
  // Takes "vol_decoder.*".
  LaraVolume(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  // What a layer's backward wants of its forward; norms and GELU it makes again.
  struct LayerSaved {
    Tensor x;                      // [R^3, C], the layer's input
    Tensor q, k, v;                // [R^3, C], [r^3 V, C]
    Tensor attended, stats;        // [R^3, C], see model/ops/dense/cross_attention.h
    Tensor middle, hidden, after;  // behind the attention; in the MLP before GELU; behind the MLP
  };
  struct Saved {
    explicit Saved(bool recompute) : recomputes(recompute) {}

    bool recomputes;  // of the layers the inputs alone are kept, and each runs once more before its backward
    RowSource lifted;
    long views = 0;
    std::vector<Kept<LayerSaved>> layers;
    Tensor last;  // [R^3, C], before the final norm
  };
  // Called with a layer's results under their golden names ("layer.0.attention"); may be none.
  using Tap = std::function<void(const std::string&, const Tensor&)>;

  // lifted: rows [r^3 V, C'] as LaraLifting gives them -> [(2R)^3, out_ch]
  Tensor forward(Context& ctx, const RowSource& lifted, long views, Saved* saved = nullptr, const Tap& tap = {}) const;

  struct Gradients {
    Tensor samples, embedded;  // by the lifted rows' two sources
  };
  // dout [(2R)^3, out_ch]. Adds to the gradients by the weights, the volume's start among them.
  Gradients backward(Context& ctx, Saved saved, const Tensor& dout) const;

 private:
  using Layer = LaraVolumeLayers<WeightLoader>::Layer;
  Tensor forward(Context& ctx, const Layer& layer, const Tensor& x, const RowSource& lifted,
                 const AttentionGroups& groups, LayerSaved* saved, const std::string& name, const Tap& tap) const;
  // dy: by the layer's output -> by its input. `out` is added to.
  Tensor backward(Context& ctx, const Layer& layer, const LayerSaved& saved, const RowSource& lifted,
                  const AttentionGroups& groups, const Tensor& dy, const Gradients& out) const;
  // For each entry of `windows`.
  std::vector<AttentionGroups> all_groups(Context& ctx, long views) const;

  LaraConfig config_;
  LaraVolumeLayers<WeightLoader> layers_;
  Tensor start_;  // [R^3, C]: stored channels first
};

}  // namespace vsplat

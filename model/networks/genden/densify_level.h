// One level of the densifier. Points, ordered along space-filling curves, pass through blocks of a submanifold
// convolution, attention within runs, and an MLP; then each is split into several points.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/densify_layers.h"
#include "model/ops/volume/space_curve.h"

namespace vsplat {

// Called with a stage's result under its golden name ("level.0.block0.conv"); may be empty.
using DensifyTap = std::function<void(const std::string&, const Tensor&)>;

// A level's points in space, and their neighbours.
struct LevelPlaces {
  GridCells cells;
  Tensor codes, points;         // in Morton order, as in CellMapForward
  Tensor standing, map;         // of cell_map_forward()
  std::vector<CurveRuns> runs;  // one per block
};

class DensifyLevelStage {
 public:
  DensifyLevelStage(const DensifyConfig& config, std::size_t s, DensifyLevel<WeightLoader> layers)
      : config_(config), s_(s), layers_(std::move(layers)) {}

  // What a block's backward needs from its forward; norms and GELU are recomputed.
  struct BlockSaved {
    Tensor x, conv, mixed;        // [P, C]: the input; after the convolution; after its Linear
    Tensor middle;                // after the sum of x and the norm of `mixed`
    Tensor qkv, attended, stats;  // in runs
    Tensor gathered;              // [P, C]: `attended` in the points' order
    Tensor after, hidden;         // after the attention; in the MLP before GELU
  };
  struct Saved {
    LevelPlaces places;
    std::vector<BlockSaved> blocks;
    Tensor last;                          // [P, C]: output of the blocks
    Tensor parent, offset_hidden, raw;    // norm of `last` [P, C]; before GELU; [P, 3 F]
    Tensor wide, feature_hidden, summed;  // [P F, W]; before GELU; before the last norm [P F, C']
  };
  struct Children {
    Tensor points, feature;  // [P F, 3], [P F, C']
  };
  // points [P, 3], feature [P, C], P at least 1. `perm`: the curve of each block.
  Children forward(Context& ctx, const Tensor& points, const Tensor& feature, const std::vector<int>& perm,
                   Saved* saved, const DensifyTap& tap) const;
  // Takes the gradients by the children; returns those by the points, dpoints [P, 3] and dfeature [P, C].
  Children backward(Context& ctx, Saved saved, const Children& dchildren) const;

  // Confidence, P -> [P]: logits of continuing to the next level.
  Tensor sureness(Context& ctx, const Tensor& feature, Tensor* hidden) const;
  void sureness_backward(Context& ctx, const Tensor& feature, const Tensor& hidden, const Tensor& dlogits,
                         const Tensor& dfeature) const;
  // Raw attributes [Q, 8 + 3 S] of features [Q, C'], added to `base` if given.
  Tensor head(Context& ctx, const Tensor& feature, const Tensor& base, Tensor* hidden) const;
  // Adds to dfeature.
  void head_backward(Context& ctx, const Tensor& feature, const Tensor& hidden, const Tensor& draw,
                     const Tensor& dfeature) const;

  double cell() const;  // edge of this level's cells

 private:
  using Block = DensifyBlock<WeightLoader>;
  LevelPlaces places(Context& ctx, const Tensor& points, const std::vector<int>& perm) const;
  Tensor block_forward(Context& ctx, const Block& block, const LevelPlaces& places, const CurveRuns& runs,
                       const Tensor& x, BlockSaved* saved, const std::string& name, const DensifyTap& tap) const;
  // d: gradient by the block's output on entry, by its input on return.
  void block_backward(Context& ctx, const Block& block, const LevelPlaces& places, const Tensor& back,
                      const CurveRuns& runs, const BlockSaved& saved, const Tensor& d) const;

  DensifyConfig config_;
  std::size_t s_;
  DensifyLevel<WeightLoader> layers_;
};

}  // namespace vsplat

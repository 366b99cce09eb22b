// One level of the densifier: points in the order of space-filling curves go through blocks of a submanifold
// convolution, attention inside runs and an MLP; then each becomes several.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/densify_layers.h"
#include "model/ops/volume/space_curve.h"

namespace vsplat {

// Called with a stage's result under its golden name ("level.0.block0.conv"); may be none.
using DensifyTap = std::function<void(const std::string&, const Tensor&)>;

// Where a level's points are, and who is whose neighbour.
struct LevelPlaces {
  GridCells cells;
  Tensor codes, points;         // by Morton's order, as CellMapForward has them
  Tensor standing, map;         // of cell_map_forward()
  std::vector<CurveRuns> runs;  // of each block
};

class DensifyLevelStage {
 public:
  DensifyLevelStage(const DensifyConfig& config, std::size_t s, DensifyLevel<WeightLoader> layers)
      : config_(config), s_(s), layers_(std::move(layers)) {}

  // What a block's backward wants of its forward; norms and GELU it makes again.
  struct BlockSaved {
    Tensor x, conv, mixed;        // [P, C]: the input; behind the convolution; behind its Linear
    Tensor middle;                // behind the sum with the norm of that
    Tensor qkv, attended, stats;  // in runs
    Tensor gathered;              // [P, C]: what was attended, in the points' order
    Tensor after, hidden;         // behind the attention; in the MLP before GELU
  };
  struct Saved {
    LevelPlaces places;
    std::vector<BlockSaved> blocks;
    Tensor last;                          // [P, C]: what the blocks made
    Tensor parent, offset_hidden, raw;    // its norm [P, C]; before GELU; [P, 3 F]
    Tensor wide, feature_hidden, summed;  // [P F, W]; before GELU; before the last norm [P F, C']
  };
  struct Children {
    Tensor points, feature;  // [P F, 3], [P F, C']
  };
  // points [P, 3], feature [P, C], P at least 1. `perm`: which curve each block takes.
  Children forward(Context& ctx, const Tensor& points, const Tensor& feature, const std::vector<int>& perm,
                   Saved* saved, const DensifyTap& tap) const;
  // From the loss by children to that by the points, dpoints [P, 3] and dfeature [P, C], which are returned.
  Children backward(Context& ctx, Saved saved, const Children& dchildren) const;

  // Confidence, P -> [P]: logits of what goes on.
  Tensor sureness(Context& ctx, const Tensor& feature, Tensor* hidden) const;
  void sureness_backward(Context& ctx, const Tensor& feature, const Tensor& hidden, const Tensor& dlogits,
                         const Tensor& dfeature) const;
  // Raw attributes [Q, 8 + 3 S] of features [Q, C'], added to `base` where it is given.
  Tensor head(Context& ctx, const Tensor& feature, const Tensor& base, Tensor* hidden) const;
  // dfeature is added to.
  void head_backward(Context& ctx, const Tensor& feature, const Tensor& hidden, const Tensor& draw,
                     const Tensor& dfeature) const;

  double cell() const;  // edge of this level's cells

 private:
  using Block = DensifyBlock<WeightLoader>;
  LevelPlaces places(Context& ctx, const Tensor& points, const std::vector<int>& perm) const;
  Tensor block_forward(Context& ctx, const Block& block, const LevelPlaces& places, const CurveRuns& runs,
                       const Tensor& x, BlockSaved* saved, const std::string& name, const DensifyTap& tap) const;
  // d: by the block's output before, by its input after.
  void block_backward(Context& ctx, const Block& block, const LevelPlaces& places, const Tensor& back,
                      const CurveRuns& runs, const BlockSaved& saved, const Tensor& d) const;

  DensifyConfig config_;
  std::size_t s_;
  DensifyLevel<WeightLoader> layers_;
};

}  // namespace vsplat

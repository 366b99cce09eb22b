// Generative Densification: replaces Gaussians that are too coarse by finer ones that grow from their features, level
// by level. A level's most confident points continue to the next level; the others are leaves.
#pragma once
#include <functional>
#include <vector>

#include "model/base/gaussians.h"
#include "model/networks/genden/densify_level.h"

namespace vsplat {

// The curve of each block of each level: a permutation of the curves per level.
using CurveOrders = std::vector<std::vector<int>>;
// The permutations that PyTorch's randperm draws level by level after manual_seed(seed).
CurveOrders random_orders(const DensifyConfig& config, std::uint64_t seed);

// Number of Gaussians after densification of so many candidates.
long densified_count(const DensifyConfig& config, long candidates);

class Densifier {
 public:
  // Loads "dec.*". `sh_count`: spherical harmonics of a Gaussian.
  Densifier(Context& ctx, const DensifyConfig& config, long sh_count, const WeightSource& weights);

  // The candidates for replacement, with their scores and features.
  struct Input {
    DeviceGaussians candidates;  // P
    Tensor score;                // [P]: the top_k largest are replaced
    // Maps the indices of replaced candidates, i32 [k], to their features [k, C]. Also runs on a plan.
    std::function<Tensor(Context&, const Tensor& selected)> features;
    CurveOrders orders;
  };
  struct Saved;
  // Returns the new Gaussians, level by level, then the candidates that were not replaced.
  DeviceGaussians forward(Context& ctx, const Input& in, std::shared_ptr<Saved>* saved = nullptr,
                          const DensifyTap& tap = {}) const;

  struct Gradients {
    Tensor selected;               // i32 [k]
    GaussianGradients candidates;  // P
    Tensor features;               // [k, C]; empty if k is 0
  };
  // Gradients of the loss, given its gradient by forward's result. Consumes `saved`.
  Gradients backward(Context& ctx, Saved& saved, const GaussianGradients& dfinal) const;

 private:
  struct LevelSaved;
  // A level's leaves: their positions, and their raw attributes [Q, 8 + 3 S].
  struct Leaves {
    Tensor points, attributes;
  };
  std::vector<Leaves> grow(Context& ctx, Tensor points, Tensor feature, const CurveOrders& orders, Saved* saved,
                           const DensifyTap& tap) const;
  DensifyLevelStage::Children grow_backward(Context& ctx, Saved& saved, const std::vector<Leaves>& dleaves) const;

  DensifyConfig config_;
  long sh_count_;
  std::vector<DensifyLevelStage> levels_;
};

}  // namespace vsplat

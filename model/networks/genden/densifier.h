// Generative Densification: Gaussians that are too coarse are replaced by what grows out of their features, level by
// level. Of a level's points the surest go on to the next one, the others are leaves.
#pragma once
#include <functional>
#include <vector>

#include "model/base/gaussians.h"
#include "model/networks/genden/densify_level.h"

namespace vsplat {

// Which curve each block of each level takes: a permutation of the curves for every level.
using CurveOrders = std::vector<std::vector<int>>;
// Those that PyTorch's randperm draws, level by level, behind manual_seed(seed).
CurveOrders random_orders(const DensifyConfig& config, std::uint64_t seed);

// How many Gaussians come of so many candidates.
long densified_count(const DensifyConfig& config, long candidates);

class Densifier {
 public:
  // Takes "dec.*". `sh_count`: spherical harmonics of a Gaussian.
  Densifier(Context& ctx, const DensifyConfig& config, long sh_count, const WeightSource& weights);

  // Gaussians of which the less fine ones are replaced, and what else is told of them.
  struct Input {
    DeviceGaussians candidates;  // P
    Tensor score;                // [P]: the top_k largest are replaced
    // i32 [k]: those -> their features [k, C]. Runs on a plan, too.
    std::function<Tensor(Context&, const Tensor& selected)> features;
    CurveOrders orders;
  };
  struct Saved;
  // The new ones, level by level, then those that were not replaced.
  DeviceGaussians forward(Context& ctx, const Input& in, std::shared_ptr<Saved>* saved = nullptr,
                          const DensifyTap& tap = {}) const;

  struct Gradients {
    Tensor selected;               // i32 [k]
    GaussianGradients candidates;  // P
    Tensor features;               // [k, C]; none where k is 0
  };
  // From the loss by what forward gave. Takes `saved` apart.
  Gradients backward(Context& ctx, Saved& saved, const GaussianGradients& dfinal) const;

 private:
  struct LevelSaved;
  // A level's leaves: where they are, and their raw attributes [Q, 8 + 3 S].
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

// What a network's forward is told, and the memory that it takes, whichever network it is.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat {

struct ForwardOptions {
  double temperature = 0.1;                     // of the Gumbel-Sigmoid
  std::optional<std::uint64_t> selection_seed;  // draw that noise from this seed instead
  Tensor noise;                                 // f32 [R^3] logistic noise on the logits; none at inference
  const std::vector<int>* selection = nullptr;  // voxel indices that replace the selected ones, ascending
  long planned_selected = 0;                    // voxels that a plan takes for selected
  // In a training of LaRa's network: without its second level, for whose sake alone the first is drawn. VS-Splat's has
  // Config::levels.
  bool fine = true;
  // Called with each stage's output under its golden name ("features", "logits", "coarse.means", ...); not while
  // planning.
  std::function<void(const std::string&, const Tensor&)> tap;
  // Called as each stage begins, with the share of the work that lies behind (0 to 1). May throw to cancel.
  std::function<void(const std::string& stage, double done)> progress;
};

// Device memory that a run takes: the network's, and that of drawing its result at the network's size ("splat", where
// each Gaussian is taken to touch RenderOptions::assumed_tiles tiles).
struct MemoryPlan {
  std::size_t weights = 0;          // bytes of slabs that hold the weights
  std::size_t peak = 0;             // bytes in all, at the most
  long selected = 0;                // voxels taken for selected
  std::vector<StageMemory> stages;  // in order of their first use
};

}  // namespace vsplat

// Options of a network's forward, and the memory that it needs, for all architectures.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat {

struct ForwardOptions {
  double temperature = 0.1;                     // temperature of the Gumbel-Sigmoid
  std::optional<std::uint64_t> selection_seed;  // draws that noise from this seed if `noise` is empty
  Tensor noise;                                 // f32 [R^3] logistic noise on the logits; empty at inference
  const std::vector<int>* selection = nullptr;  // voxel indices that replace the selected ones, ascending
  long planned_selected = 0;                    // selected voxels that a plan assumes
  // Only in LaRa's training: false skips the second level, and with it the rendering of the first. VS-Splat uses
  // Config::levels.
  bool fine = true;
  // Called with each stage's output under its golden name ("features", "logits", "coarse.means", ...), but not while
  // planning.
  std::function<void(const std::string&, const Tensor&)> tap;
  // Called at the start of each stage, with the share of the work that is done (0 to 1). May throw to cancel.
  std::function<void(const std::string& stage, double done)> progress;
};

// Device memory of a run: the network's, and that of rendering its result at the network's size (which assumes that
// each Gaussian touches RenderOptions::assumed_tiles tiles).
struct MemoryPlan {
  std::size_t weights = 0;          // bytes of slabs that hold the weights
  std::size_t peak = 0;             // maximum of all bytes in use
  long selected = 0;                // selected voxels assumed
  std::vector<StageMemory> stages;  // in order of their first use
};

}  // namespace vsplat

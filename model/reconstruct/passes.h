// A network's forward passes about one object, each with another view as the reference, and their common result.
#pragma once
#include <vector>

#include "model/base/camera.h"
#include "model/base/gaussians.h"
#include "model/networks/network.h"

namespace vsplat {

struct PassOptions {
  int count = 1;          // passes, or as many as there are views
  double merge_cell = 0;  // in voxels: volumes that share a cell become one (merged_in_cells()); 0: they stay
  bool coarse = false;    // the coarse level is wanted, too
};

// Both levels are in the frame of the first view. A network's errors depend on its frame, so that the passes err
// differently, and their mean (mean_of()) errs less than each.
struct Passes {
  Gaussians coarse, final;
  Network::Result first;  // of the first pass, whose reference is the first view
};

// `pictures`: [V, S, S, 3] values. `cameras`: as for Network::forward(), in the frame of the first view.
// ForwardOptions::progress counts all passes; a selection and a tap are for one pass only.
Passes forward_passes(Context& ctx, const Network& network, const std::vector<float>& pictures,
                      const std::vector<Camera>& cameras, const PassOptions& passes, const ForwardOptions& options);

}  // namespace vsplat

// The product's main job: prepared views and a placed cube in, a scene in the user's own frame out.
#pragma once
#include <string>
#include <vector>

#include "model/base/scene.h"
#include "model/networks/network.h"
#include "model/views/placement.h"
#include "model/views/views.h"

namespace vsplat {

struct ReconstructOptions {
  double near = 0;      // near plane in world units; 0: 0.2 of the cube's edge
  bool masked = false;  // the pictures' background was taken away by masks or alpha
  ForwardOptions forward;
  std::string dump;  // a folder for every stage's output; empty: none
};

struct Reconstruction {
  Scene scene;                // in the user's world: positions (relative to its offset), scales, rotations and SH
  std::vector<int> selected;  // voxels, or those with a primitive that is: ascending
};

// `views`: at least one, as many as the network takes at the most; the first is the reference view; pictures of the
// configuration's size.
Reconstruction reconstruct(Context& ctx, const Network& network, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options);

}  // namespace vsplat

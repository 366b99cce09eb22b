// The product's main job: prepared views and a placed cube in, a scene in the user's own frame out.
#pragma once
#include <string>
#include <vector>

#include "model/base/scene.h"
#include "model/genden/genden_model.h"
#include "model/genden/vsplat_genden_model.h"
#include "model/input/placement.h"
#include "model/input/views.h"
#include "model/lara/lara_model.h"
#include "model/network/vsplat_model.h"

namespace vsplat {

struct ReconstructOptions {
  double near = 0;      // near plane in world units; 0: 0.2 of the cube's edge
  bool masked = false;  // the pictures' background was taken away by masks or alpha
  ForwardOptions forward;
  std::string dump;  // a folder for every stage's output; empty: none
};

struct Reconstruction {
  Scene scene;                // in the user's world: positions (relative to its offset), scales, rotations and SH
  std::vector<int> selected;  // voxels, ascending
};

// `views`: at least one, the first is the reference view; pictures of the configuration's size.
Reconstruction reconstruct(Context& ctx, const VsplatModel& model, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options);
// The same with LaRa's network, at most view_slots views; of `forward` it takes `tap`, `progress` and
// `planned_selected`, a number of primitives here. `selected` are the voxels that have a kept one.
Reconstruction reconstruct(Context& ctx, const LaraModel& model, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options);

// With GenDen's network: as LaRa's, and `selection_seed` is that of the order in which its curves are taken; 0 without.
Reconstruction reconstruct(Context& ctx, const GendenModel& model, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options);
// With VS-Splat's and the densifier: as VS-Splat's; the order of the curves is that of seed 0.
Reconstruction reconstruct(Context& ctx, const VsplatGendenModel& model, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options);

}  // namespace vsplat

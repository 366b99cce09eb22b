// The product's main task: from prepared views and a placed cube to a scene in the user's frame.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "model/base/scene.h"
#include "model/networks/network.h"
#include "model/views/placement.h"
#include "model/views/views.h"

namespace vsplat {

struct ReconstructOptions {
  double near = 0;      // near plane in world units; 0: 0.2 of the cube's edge
  bool masked = false;  // the pictures' background was removed by masks or alpha
  ForwardOptions forward;
  std::optional<int> passes;         // the model's if not given; one with a selection or a dump
  std::optional<double> merge_cell;  // the model's if not given; see PassOptions
  std::optional<int> fit_epochs;     // the model's if not given; none with a dump; see InputsFit
  std::string dump;                  // folder for every stage's output; empty: no dump
};

struct Reconstruction {
  Scene scene;  // in the user's world: positions (relative to its offset), scales, rotations and SH
  // Voxels that are selected or hold a selected primitive, ascending; of the first pass.
  std::vector<int> selected;
};

// `views`: one up to as many as the network takes; the first is the reference view. Pictures have the configuration's
// size.
Reconstruction reconstruct(Context& ctx, const Network& network, const std::vector<PreparedView>& views,
                           const Placement& placement, const ReconstructOptions& options);

}  // namespace vsplat

// Checks whether the network's selection can be an object in its cube, by how much of the cube it fills.
#pragma once
#include <span>
#include <string>
#include <vector>

#include "model/views/views.h"

namespace vsplat {

// Shares from 0 to 1: of all voxels, and of those at the cube's faces.
struct SelectedShares {
  double all = 0, faces = 0;
};
// `selected`: indices of an R x R x R volume, R >= 1.
SelectedShares selected_shares(std::span<const int> selected, int volume);

// Whether the pictures show something at their edges, most likely a background that is not white. `views` on white.
bool shows_background(std::span<const PreparedView> views);

// What seems to be wrong with the pictures or the cube, and what to do. Returns "" if nothing is wrong, or if there are
// too few voxels to judge. `background`: result of shows_background(), for pictures without mask or alpha.
std::string doubts_about(const SelectedShares& shares, int volume, bool background);

}  // namespace vsplat

// Whether what the network selected can be an object in its cube, told by how much of the cube it fills.
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

// Whether the pictures' edges show something: a background that is not white, most likely. `views` on white.
bool shows_background(std::span<const PreparedView> views);

// What seems to be wrong with the pictures or the cube, and what to do; "" where nothing does, or where there are too
// few voxels to tell. `background`: as shows_background() has it, of pictures without mask or alpha.
std::string doubts_about(const SelectedShares& shares, int volume, bool background);

}  // namespace vsplat

// From listed photographs to what the network takes: which views, where the object is, the checks, the pictures.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "model/config.h"
#include "model/io/view_set.h"
#include "model/placement.h"
#include "model/view_choice.h"
#include "model/views.h"

namespace vsplat {

// Photographs as listed: their pictures in files, or all of them in memory.
struct Photographs {
  ViewSet set;
  std::vector<Image> pictures;  // one per view of the set, or none; 3 or 4 channels
};

struct InputRequest {
  std::vector<std::string> names;  // as ViewRequest has them
  PlacementRequest placement;
  Fit fit = Fit::automatic;
  bool force = false;  // of check_centre_is_seen()
};

struct Input {
  std::vector<PreparedView> views;  // cameras in the user's world; the first is the reference view
  Placement placement;
};
std::vector<Camera> cameras_of(const Input& input);

// Chooses, places, checks and prepares; says what it chose and found as information in the log.
Input prepare_input(const Photographs& photographs, const Config& config, const InputRequest& request);

}  // namespace vsplat

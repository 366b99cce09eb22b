// From listed photographs to what the network takes: which views, where the object is, the checks, the pictures.
#pragma once
#include <span>
#include <string>
#include <vector>

#include "model/networks/params/config.h"
#include "model/views/photographs.h"
#include "model/views/placement.h"
#include "model/views/view_choice.h"
#include "model/views/views.h"

namespace vsplat {

// Where the object is, from what is asked for, listed, or estimated from these views, which are loaded for it one after
// the other. `points`: of their world; without, those of listed_points() are looked at where something is estimated.
ChosenPlacement find_placement(const Photographs& photographs, std::span<const int> views,
                               const PlacementRequest& request, const std::vector<ColoredPoint>* points = nullptr);

struct InputRequest {
  std::vector<std::string> names;  // as ViewRequest has them
  int view_count = 0;              // how many views where none are named; 0: TakenViews::usual
  PlacementRequest placement;
  Fit fit = Fit::automatic;
  bool force = false;  // of check_centre_is_seen()
};

struct Input {
  std::vector<PreparedView> views;  // cameras in the user's world; the first is the reference view
  Placement placement;
  bool masked = false;  // every picture has a mask or alpha
};
std::vector<Camera> cameras_of(const Input& input);

// Chooses, places, checks and prepares; says what it chose and found as information in the log.
Input prepare_input(const Photographs& photographs, const TakenViews& taken, const InputRequest& request);

}  // namespace vsplat

// Turns listed photographs into network input: chooses views, locates the object, checks and prepares the pictures.
#pragma once
#include <span>
#include <string>
#include <vector>

#include "model/base/taken_views.h"
#include "model/views/photographs.h"
#include "model/views/placement.h"
#include "model/views/view_choice.h"
#include "model/views/views.h"

namespace vsplat {

// The object's placement: as requested, as listed, or estimated from these views, which are loaded one after the other.
// `points` are in the views' world; without them, an estimate uses listed_points().
ChosenPlacement find_placement(const Photographs& photographs, std::span<const int> views,
                               const PlacementRequest& request, const std::vector<ColoredPoint>* points = nullptr);

struct InputRequest {
  std::vector<std::string> names;  // as in ViewRequest
  int view_count = 0;              // number of views if none are named; 0: TakenViews::usual
  PlacementRequest placement;
  Crop crop = Crop::automatic;
  bool force = false;  // for check_centre_is_seen()
};

struct Input {
  std::vector<PreparedView> views;  // cameras in the user's world; the first is the reference view
  Placement placement;
  bool masked = false;  // every picture has a mask or alpha
};
std::vector<Camera> cameras_of(const Input& input);

// Chooses, places, checks and prepares the views; logs its choices and findings as information.
Input prepare_input(const Photographs& photographs, const TakenViews& taken, const InputRequest& request);

}  // namespace vsplat

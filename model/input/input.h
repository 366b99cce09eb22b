// From listed photographs to what the network takes: which views, where the object is, the checks, the pictures.
#pragma once
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "model/input/placement.h"
#include "model/input/view_choice.h"
#include "model/input/views.h"
#include "model/io/view_set.h"
#include "model/params/config.h"

namespace vsplat {

// Photographs as listed.
struct Photographs {
  ViewSet set;
  // Makes the picture of a view (by its index; 3 or 4 channels). Empty: pictures are in the views' files.
  std::function<Image(int)> picture = {};
};

// The listed view with all its intrinsics: what it leaves open comes from its picture's size.
ListedView resolved_view(const Photographs& photographs, int view);

// Where the object is, from what is asked for, listed, or estimated from these views.
ChosenPlacement find_placement(const Photographs& photographs, std::span<const int> views,
                               const PlacementRequest& request);

// A view as the network gets it, its background still open.
FramedView framed_view(const Photographs& photographs, int view, const Framing& framing);

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

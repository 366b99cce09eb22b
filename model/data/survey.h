// Statistics of an object in a data set.
#pragma once
#include <string>
#include <vector>

#include "model/data/data_set.h"

namespace vsplat {

struct Extent {
  double low = 0, high = 0;
};

struct ObjectSurvey {
  int views = 0;                 // usable views
  std::vector<std::string> bad;  // problems of other views, and of the decoded pictures
  Extent width, height;          // pixels
  Extent fov;                    // degrees, horizontal
  Extent distance;               // of the cameras from the cube's centre, in cube edges
  Placement placement;
  int looked_at = 0;    // pictures that were decoded
  double coverage = 0;  // mean alpha of these over the network's square
};

// Decodes `pictures` of the object's pictures, spread over the views; -1: all. Throws Error if the object as a whole is
// bad.
ObjectSurvey survey(const DataObject& object, int pictures);

// `count` of `of` indices, evenly spread; all if there are fewer.
std::vector<int> spread(int count, int of);

}  // namespace vsplat

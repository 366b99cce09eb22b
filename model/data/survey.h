// What there is of an object in a data set, in numbers.
#pragma once
#include <string>
#include <vector>

#include "model/data/data_set.h"

namespace vsplat {

struct Extent {
  double low = 0, high = 0;
};

struct ObjectSurvey {
  int views = 0;                 // that can be used
  std::vector<std::string> bad;  // what is wrong with others, and with pictures that were looked at
  Extent width, height;          // pixels
  Extent fov;                    // degrees, across the picture
  Extent distance;               // of the cameras from the cube's middle, in its edges
  Placement placement;
  int looked_at = 0;    // pictures that were decoded
  double coverage = 0;  // the mean of their alpha over the square that the network sees
};

// Looks into `pictures` of its pictures, spread over the views; -1: all. Error where the object as a whole is bad.
ObjectSurvey survey(const DataObject& object, int pictures);

// `count` of `of` indices, evenly spread; all where there are fewer.
std::vector<int> spread(int count, int of);

}  // namespace vsplat

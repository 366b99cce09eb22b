// Reads pictures of depth.
#pragma once
#include <string>

#include "model/base/image.h"

namespace vsplat {

struct DepthImage {
  Image values;        // 1 channel, as stored, in rows from the top; 0: unknown
  bool whole = false;  // whether the file holds whole numbers, in a unit of its own
};

// A grey PNG of 8 or 16 bits, or the channel Z of an EXR, else its only channel; what is not finite, or not above 0, is
// unknown. Error(format) for other files and for pictures with colours, Error(file) if it cannot be opened.
DepthImage read_depth(const std::string& path);

}  // namespace vsplat

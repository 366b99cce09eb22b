// How many views a network accepts, and at which size.
#pragma once
#include <string>

namespace vsplat {

// The views that a network accepts.
struct TakenViews {
  int image;           // edge in pixels
  int trained;         // number of views in training and evaluation
  int usual;           // number that a reconstruction picks if more are available
  int most;            // upper limit
  std::string rebase;  // rotate, move
};

}  // namespace vsplat

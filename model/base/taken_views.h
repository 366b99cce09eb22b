// How many views a network accepts, and at which size.
#pragma once
#include <string>

namespace vsplat {

// The views that a network accepts, and how a reconstruction uses it.
struct TakenViews {
  int image;           // edge in pixels
  int trained;         // number of views in training and evaluation
  int usual;           // number that a reconstruction picks if more are available
  int most;            // upper limit
  std::string rebase;  // rotate, move
  int passes = 1;      // forward passes of a reconstruction, each with another view as the reference
  // Edge of the cells in which a reconstruction's Gaussians become one, in voxels; 0: they stay.
  double merge_cell = 0;
  int cells = 1;       // voxels along the cube's edge
  int fit_epochs = 0;  // of the fit to the inputs that ends a reconstruction: in each, every input gets a step
};

}  // namespace vsplat

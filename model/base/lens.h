// Lens distortion, forward: from undistorted normalised coordinates to where the lens puts them.
#pragma once
#include "model/base/camera.h"

namespace vsplat {

class Lens {
 public:
  // `largest_radius`: how far from the axis, in undistorted normalised coordinates, points will be asked for.
  Lens(const Distortion& distortion, double largest_radius);

  // False where nothing is seen: at and beyond the radius where the polynomial folds back, so that no ray is found
  // twice.
  bool distort(double x, double y, double& distorted_x, double& distorted_y) const;

  // The radius of the fold; infinite where there is none up to `largest_radius`.
  double fold() const { return fold_; }

 private:
  Distortion distortion_;
  double fold_;
};

// Whether some ray is seen at that distance from the axis, in distorted normalised coordinates: the lens folds back
// only beyond it. Tangential parameters are passed over.
bool reaches(const Distortion& distortion, double radius);

// Whether the model is `none` or all its parameters are 0.
bool is_pinhole(const Distortion& distortion);

}  // namespace vsplat

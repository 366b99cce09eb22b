// Applies lens distortion: from undistorted normalised coordinates to distorted ones.
#pragma once
#include "model/base/camera.h"

namespace vsplat {

class Lens {
 public:
  // `largest_radius`: limit on the distance from the axis, in undistorted normalised coordinates, of the points to map.
  Lens(const Distortion& distortion, double largest_radius);

  // False if the point is not visible: at and beyond the radius where the polynomial folds back, so that no position is
  // reached twice.
  bool distort(double x, double y, double& distorted_x, double& distorted_y) const;

  // The radius of the fold; infinite if there is none up to `largest_radius`.
  double fold() const { return fold_; }

 private:
  Distortion distortion_;
  double fold_;
};

// Whether any ray reaches that distance from the axis, in distorted normalised coordinates, before the lens folds back.
// Ignores tangential parameters.
bool reaches(const Distortion& distortion, double radius);

// Whether the model is `none`, or `opencv` with all parameters 0.
bool is_pinhole(const Distortion& distortion);

}  // namespace vsplat

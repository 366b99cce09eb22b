// How far the values of two scenes of the same Gaussians are apart, such as a scene and its copy from a file that
// rounds.
#pragma once
#include <cstdint>

#include "model/base/scene.h"

namespace vsplat {

struct Differences {
  double largest = 0, rms = 0;
};

struct SceneDifference {
  // False if the scenes' Gaussians are in another order, so that each was compared with the one most like it among the
  // nearest.
  bool in_order = true;
  Differences means;      // distances, world units
  Differences scales;     // standard deviations, world units
  Differences rotations;  // angles, degrees
  Differences opacities;
  Differences sh;  // coefficients; those of a degree that one scene lacks are 0 there
};

// Error(input) if the scenes have different numbers or kinds of Gaussians.
SceneDifference difference(const Scene& scene, const Scene& other);

}  // namespace vsplat

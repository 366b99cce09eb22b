// Adds Gaussians to a scene or removes them.
#pragma once
#include <cstdint>
#include <functional>

#include "model/base/scene.h"

namespace vsplat {

// Adds the contents of `other`, transformed in the world by `move`. The lower degree of spherical harmonics is raised
// with zeros, and the nearer of the two near planes is kept. Other properties are those of `to`, or of `other` if `to`
// has no Gaussians. Error(input) if one has surfels and the other volumes.
//
// A picture is drawn with a single mirror point. If the two differ, or only one scene has one, the result has none: the
// colours of a scene with a mirror point are converted to the opposite direction. That is exact for a Gaussian at the
// mirror point and less accurate with the distance from it, so there is a warning.
void append(Scene& to, const Scene& other, const Similarity& move);

// Converts colours to the viewing direction itself, as append() does; the scene then has no mirror point.
void drop_mirror(Scene& scene);

// Leaves out the bands of higher degrees, or adds them with zeros.
void set_degree(Gaussians& gaussians, int degree);

// Adds Gaussians of the same kind and degree, which are not checked.
void append(Gaussians& to, const Gaussians& more);

// Keeps the Gaussians for which `keeps` is true, in their order.
void keep(Gaussians& gaussians, const std::function<bool(std::size_t)>& keeps);

}  // namespace vsplat

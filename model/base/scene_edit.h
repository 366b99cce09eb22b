// Changes to a scene: more Gaussians, or fewer.
#pragma once
#include <cstdint>
#include <functional>

#include "model/base/scene.h"

namespace vsplat {

// Adds what `other` holds, moved in the world by `move`. The lower degree of spherical harmonics becomes the higher one
// with zeros, the nearer of the two near planes is kept; what else a scene knows is `to`'s, or where that has no
// Gaussian, `other`'s. Error(input) where one has surfels and the other volumes.
//
// A picture is drawn with one mirror point. Where the two have different ones, or one has none, none is left: the
// colours of the scene that had one are turned about, which is the same for a Gaussian at the mirror point, and the
// less so the farther one lies from it. That is a warning.
void append(Scene& to, const Scene& other, const Similarity& move);

// Keeps the Gaussians of which `keeps` is true, in their order.
void keep(Gaussians& gaussians, const std::function<bool(std::size_t)>& keeps);

}  // namespace vsplat

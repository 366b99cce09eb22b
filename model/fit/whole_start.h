// The start of a fit of a whole scene: the sparse points, and Gaussians where pictures look and no points are.
#pragma once
#include <cstdint>
#include <vector>

#include "model/base/scene.h"
#include "model/views/photographs.h"
#include "model/views/scene_frame.h"

namespace vsplat {

struct WholeStart {
  SceneFrame frame;
  std::vector<ColoredPoint> points;  // in the world; may be empty
  long most = 0;                     // limit of the number of Gaussians; 0: none
  long random = 0;                   // number of Gaussians without points
  std::uint64_t seed = 0;
};

// Gaussians of isotropic_scene(), coloured by what `views` show:
// - one at each point, or at an even sample of the points if there are too many;
// - without points `random`, of opacity 0.1, at random pixels of the views and random depths about the point where the
//   axes meet (or about five units if they do not meet);
// - in addition 5 %, at most 10,000, at a distance of 10 to 100 units, at random pixels where no points are.
// Equal arguments give equal scenes.
Scene whole_scene(const WholeStart& start, const Photographs& photographs, const std::vector<int>& views);

// The scene with an object in place of what it has in the object's cube. The object's Gaussians are merged to at most
// `most`.
Scene with_object(Scene scene, Scene object, const Placement& cube, std::size_t most);

}  // namespace vsplat

// Indoor backgrounds for objects that were photographed or rendered without one, as in users' photographs without
// masks.
#pragma once
#include <Eigen/Core>
#include <array>

#include "model/data/framed_object.h"
#include "model/data/paints.h"

namespace vsplat {

// A box seen from inside, wherever the camera is; walls between the camera and the object are invisible.
struct Room {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();  // from the object's frame to the box's axes
  Eigen::Vector3d half = Eigen::Vector3d::Ones();      // half of the box's edges, in edges of the object's cube
  std::array<Paint, 6> walls;                          // for -x, +x, -y, +y, -z, +z
  float light = 1;                                     // on all walls, 0 to 1
  // Share of the pictures' width and height that is shown; the rest is empty, as for a portrait picture padded to a
  // square.
  Eigen::Vector2d shown = Eigen::Vector2d::Ones();
};

// Random orientation, walls 0.7 to 5 edges from the middle; half of them with a partly shown picture. `textures` may be
// null.
Room random_room(Random& random, const TextureFolder* textures);

// sRGB colour of the wall that a ray meets behind the object; of a box eight times as large if the ray misses this one.
Eigen::Vector3f wall_colour(const Room& room, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction);

// The view with the walls drawn behind the object. `camera` is in the object's frame. Alpha becomes 1 in the shown part
// and 0 outside it. A view that is opaque or not masked has its own background and stays unchanged.
StoredView in_room(const StoredView& view, const Camera& camera, const Room& room);

}  // namespace vsplat

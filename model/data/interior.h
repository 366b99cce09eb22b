// A room about an object that was photographed or drawn without one, as behind what users photograph and do not mask.
#pragma once
#include <Eigen/Core>
#include <array>

#include "model/data/framed_object.h"
#include "model/data/paints.h"

namespace vsplat {

// A box, seen from inside wherever the camera is: a wall between it and the object is not there.
struct Room {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();  // from the object's frame to the box's axes
  Eigen::Vector3d half = Eigen::Vector3d::Ones();      // of its edges, in edges of the object's cube
  std::array<Paint, 6> walls;                          // of -x, +x, -y, +y, -z, +z
  float light = 1;                                     // on all of them, 0 to 1
  // What the pictures show of their width and height; beside it there is nothing, as of a portrait made square.
  Eigen::Vector2d shown = Eigen::Vector2d::Ones();
};

// Turned at random, walls 0.7 to 5 edges from the middle; half of the rooms are shown in part. `textures` may be null.
Room random_room(Random& random, const TextureFolder* textures);

// sRGB of the wall that a ray meets, farther off than the object; of a box eight times as large where it passes by.
Eigen::Vector3f wall_colour(const Room& room, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction);

// The view with the room behind what it shows, seen with `camera`, which is in the object's frame: alpha is 1 in all
// that is shown and 0 beside it. A view that is opaque, or that nothing masks, has a background of its own and stays as
// it is.
StoredView in_room(const StoredView& view, const Camera& camera, const Room& room);

}  // namespace vsplat

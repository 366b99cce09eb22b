// Triangle meshes that objects are built from: surfaces, differences, tubes and warps.
#pragma once
#include <Eigen/Geometry>
#include <functional>
#include <span>
#include <vector>

#include "model/data/bodies.h"
#include "model/data/mesh.h"

namespace vsplat {

// Three corners per triangle, wound to be seen from outside. Adjacent triangles have bitwise equal positions.
using Triangles = std::vector<Corner>;
using Warp = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

// A grid of `around` x `along` squares over the surface, with (u, v) as texture coordinates.
Triangles tessellated(const Surface& surface, int around, int along);

// The part of the triangles inside (or outside); triangles that cross the border are cut there.
Triangles part_of(const Triangles& from, const Inside& inside, bool within);

// A body with a second body cut out of it: the rest of its surface, and the walls of the cut, which are the second
// body's surface seen from inside. `place` transforms `cutter` to the first body's frame.
struct Cut {
  Triangles outside, walls;
};
Cut difference(const Body& body, const Body& cutter, const Eigen::Affine3d& place, int around, int along);

// A tube with `sides` sides around a line of at least two points; closed into itself, or with flat caps at both ends.
Triangles tube(std::span<const Eigen::Vector3d> line, bool closed, double radius, int sides);

// A wire frame of tubes: `around` lines from pole to pole of the surface and `along` rings around it.
Triangles wires(const Surface& surface, int around, int along, double radius);

void warp(Triangles& triangles, const Warp& by);

// Rotation about y by an angle proportional to y, in radians per unit.
Warp twist(double per_unit);
// Bends the y axis to an arc in the xy plane, in radians per unit.
Warp bend(double per_unit);
// Widens one end of y in [-1,1] and narrows the other.
Warp taper(double by);
// A height field: moves each point away from the origin by a sum of waves over its direction, at most by `height`.
Warp bumps(double height, Random& random);

}  // namespace vsplat

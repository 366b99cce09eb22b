// Triangles that objects are put together from: surfaces, what is cut out of them, tubes, and what bends them.
#pragma once
#include <Eigen/Geometry>
#include <functional>
#include <span>
#include <vector>

#include "model/data/bodies.h"
#include "model/data/mesh.h"

namespace vsplat {

// Three corners each, wound so that they are seen from outside; where triangles meet, positions are equal to the bit.
using Triangles = std::vector<Corner>;
using Warp = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

// A grid of `around` x `along` squares over the surface, (u, v) as texture coordinates.
Triangles tessellated(const Surface& surface, int around, int along);

// What of the triangles is within, or without; those that the border crosses are cut there.
Triangles part_of(const Triangles& from, const Inside& inside, bool within);

// A body out of which a second one is cut: what is left of its surface, and the walls of the cut, which are the second
// one's surface seen from within. `cutter` is moved into the first one's frame by `place`.
struct Cut {
  Triangles outside, walls;
};
Cut difference(const Body& body, const Body& cutter, const Eigen::Affine3d& place, int around, int along);

// Round a line of at least two points, with `sides` sides; closed into itself, or at both ends by flat caps.
Triangles tube(std::span<const Eigen::Vector3d> line, bool closed, double radius, int sides);

// `around` lines from pole to pole of the surface and `along` about it, as tubes.
Triangles wires(const Surface& surface, int around, int along, double radius);

void warp(Triangles& triangles, const Warp& by);

// Turned about y by an angle that grows along it, in radians per unit.
Warp twist(double per_unit);
// The y axis becomes an arc in the plane of x and y, by an angle of so much per unit.
Warp bend(double per_unit);
// Wider at one end of y in [-1,1] than at the other.
Warp taper(double by);
// A height field: each point moved away from the origin, by a sum of waves over its direction of that height at most.
Warp bumps(double height, Random& random);

}  // namespace vsplat

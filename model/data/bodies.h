// Closed surfaces that solids are built from, each also as an implicit function.
#pragma once
#include <Eigen/Core>
#include <functional>

#include "model/data/random.h"

namespace vsplat {

// A surface over (u, v) in [0,1]^2, with u around the axis; centred at the origin, within [-1,1]^3.
using Surface = std::function<Eigen::Vector3d(double u, double v)>;
// Below 0 inside a body, 0 on its surface, above 0 outside.
using Inside = std::function<double(const Eigen::Vector3d&)>;

struct Body {
  Surface surface;
  Inside inside;
};

// A superellipsoid with exponents from 0.1 (edges) over 1 (a ball) to 2 (points), for the outline seen from the side
// and from above.
Body superellipsoid(double upright, double round);
// A torus about y with this thickness of its tube.
Body ring(double thickness);
// A body of revolution whose profile is a sum of three waves, closed at both ends.
Body vase(Random& random);

// A box, a cylinder, a ball, a ring, a vase or a superellipsoid.
Body random_body(Random& random);

// Uniform random rotation by Shoemake's quaternions.
Eigen::Matrix3d random_rotation(Random& random);

}  // namespace vsplat

// Closed surfaces that solids are put together from, each also as a function that tells inside from outside.
#pragma once
#include <Eigen/Core>
#include <functional>

#include "model/data/random.h"

namespace vsplat {

// Over (u, v) in [0,1]^2, u going round; about the origin, within [-1,1]^3.
using Surface = std::function<Eigen::Vector3d(double u, double v)>;
// Below 0 within a body, 0 on its surface, above 0 outside.
using Inside = std::function<double(const Eigen::Vector3d&)>;

struct Body {
  Surface surface;
  Inside inside;
};

// Of exponents from 0.1 (edges) over 1 (a ball) to 2 (points): of the outline seen from the side, and from above.
Body superellipsoid(double upright, double round);
// About y; what goes round is so much of it thick.
Body ring(double thickness);
// A body of revolution whose profile is a sum of three waves, closed at both ends.
Body vase(Random& random);

// A box, a cylinder, a ball, a ring, a vase or a superellipsoid.
Body random_body(Random& random);

// Shoemake's uniform quaternions.
Eigen::Matrix3d random_rotation(Random& random);

}  // namespace vsplat

// World axes as three letters: where +x, +y and +z point, each R or L (right, left), U or D (up, down) or F or B
// (forward, back). RDF is COLMAP's and 3DGS's world, RUB that of OpenGL and SPZ, LUF that of glTF's models.
#pragma once
#include <Eigen/Core>
#include <string_view>

namespace vsplat {

// The axes as columns, in a world with x right, y up, z back. Determinant 1 for right-handed axes, -1 for left-handed
// ones. Error(usage) unless the letters, in either case, are one of each pair.
Eigen::Matrix3d axes_of(std::string_view letters);

// The matrix that turns coordinates along the axes `from` into coordinates along `to`. It mirrors (determinant -1) if
// one is right-handed and the other is not: the place stays the same, only its coordinates are of the other hand.
Eigen::Matrix3d change_of_axes(std::string_view from, std::string_view to);

// The up direction, in coordinates along these axes.
Eigen::Vector3d up_of_axes(std::string_view letters);

}  // namespace vsplat

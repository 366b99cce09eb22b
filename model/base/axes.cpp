#include "model/base/axes.h"

#include <Eigen/LU>
#include <cctype>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

// Zero for other letters.
Eigen::Vector3d direction_of(char letter) {
  switch (std::toupper(static_cast<unsigned char>(letter))) {
    case 'R':
      return {1, 0, 0};
    case 'L':
      return {-1, 0, 0};
    case 'U':
      return {0, 1, 0};
    case 'D':
      return {0, -1, 0};
    case 'B':
      return {0, 0, 1};
    case 'F':
      return {0, 0, -1};
    default:
      return {0, 0, 0};
  }
}

}  // namespace

Eigen::Matrix3d axes_of(std::string_view letters) {
  Eigen::Matrix3d out = Eigen::Matrix3d::Zero();
  if (letters.size() == 3)
    for (std::size_t i = 0; i < 3; ++i) out.col(static_cast<Eigen::Index>(i)) = direction_of(letters[i]);
  if (out.determinant() == 0)
    fail(Status::usage,
         "\"{}\" names no axes: three letters are expected, one of R and L, one of U and D and one of F and B, which "
         "say where +x, +y and +z point, such as RDF",
         printable(letters));
  return out;
}

Eigen::Matrix3d change_of_axes(std::string_view from, std::string_view to) {
  return axes_of(to).transpose() * axes_of(from);
}

Eigen::Vector3d up_of_axes(std::string_view letters) { return axes_of(letters).transpose() * Eigen::Vector3d(0, 1, 0); }

}  // namespace vsplat

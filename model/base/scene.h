// A scene as stored in files: Gaussians in one frame, with the parameters for drawing them.
#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>

#include "model/base/gaussians.h"

namespace vsplat {

// The constant spherical harmonic: without other coefficients, a colour is 0.5 + kShC0 times the first one.
inline constexpr double kShC0 = 0.28209479177387814;

// The near plane of reconstructed scenes, in units of the cube's edge.
inline constexpr double kNearInObject = 0.2;

struct Camera;

// The resolution of the pictures that a scene was made from.
struct Detail {
  std::array<float, 3> at{};  // the object's centre, in the scene's frame
  float pixel = 0;            // width of one of those pictures' pixels there, in the frame's units; above 0
};

struct Scene {
  Gaussians gaussians;
  // World position of the origin of the Gaussians' and the mirror point's frame; 0 unless offset_for() requires
  // another.
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  float near = 0.2f;  // near plane, in the frame's units
  // View-dependent colour is evaluated from the camera's mirror image about this point.
  std::optional<std::array<float, 3>> mirror;
  std::optional<Detail> detail;            // nothing if unknown
  std::optional<std::array<float, 3>> up;  // up direction in the frame, of length 1; nothing if unknown
  // Whether it is made to be drawn as with RenderOptions::antialias; volumes only.
  bool antialias = false;
};

// x -> scale rotation x + translation. The rotation is proper, or for transform() alone one that also mirrors.
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  static Similarity from_matrix(
      const Eigen::Matrix4d& m);  // Error(input) unless the upper 3x3 is a scale times a rotation
  Similarity inverse() const;
  Eigen::Vector3d apply(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }
};
Similarity operator*(const Similarity& after, const Similarity& before);

// Transforms positions, scales, rotations and spherical harmonics: a camera that moves along sees the same picture.
void transform(Gaussians& gaussians, const Similarity& move);
// Also transforms the near plane, mirror point, detail and up. `move` acts in the world; the result is relative to
// `offset`.
void transform(Scene& scene, const Similarity& move, const Eigen::Vector3d& offset = Eigen::Vector3d::Zero());

// Converts surfels to volumes: the third scale is `thickness` times the smaller of a surfel's two.
Gaussians thickened(const Gaussians& surfels, double thickness);

// Larger offsets are refused: doubles do not resolve an object there.
inline constexpr double kFarthestOffset = 1e15;

// The origin for a cube's Gaussians: the world's origin if floats hold world positions to 1e-4 of the cube's edge, else
// the cube's centre, so that a distant cube loses no precision.
Eigen::Vector3d offset_for(const Eigen::Vector3d& centre, double edge);
// Converts a camera from the world to the frame of the scene's Gaussians.
Camera in_frame(const Scene& scene, const Camera& camera);

// The matrix [2l+1, 2l+1] that rotates band `degree` of a function on the sphere: with coefficients c' = D c in the
// basis of 3DGS files, f'(R d) = f(d).
Eigen::MatrixXd sh_rotation(int degree, const Eigen::Matrix3d& rotation);
// The basis of 3DGS files, continued: (degree + 1)^2 values for a unit direction, degree 0 to 4.
Eigen::VectorXd sh_basis(int degree, const Eigen::Vector3d& direction);

}  // namespace vsplat

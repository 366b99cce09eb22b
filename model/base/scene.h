// A scene as files hold it: Gaussians in one frame, and how they were meant to be drawn.
#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>

#include "model/base/gaussians.h"

namespace vsplat {

// The constant spherical harmonic: a colour is 0.5 + kShC0 times its first coefficient, where there are no others.
inline constexpr double kShC0 = 0.28209479177387814;

// The near plane of what is reconstructed, in units of the cube's edge.
inline constexpr double kNearInObject = 0.2;

struct Camera;

// How fine the pictures were that a scene was made from.
struct Detail {
  std::array<float, 3> at{};  // the object's middle, in the scene's frame
  float pixel = 0;            // how wide a pixel of those pictures is there, in the frame's units; above 0
};

struct Scene {
  Gaussians gaussians;
  // Where in the world the frame of Gaussians and mirror point begins; 0 unless offset_for() has it otherwise.
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  float near = 0.2f;  // near plane, in the frame's units
  // View-dependent colour is meant as seen from the camera's mirror image about this point.
  std::optional<std::array<float, 3>> mirror;
  std::optional<Detail> detail;            // none: not known
  std::optional<std::array<float, 3>> up;  // which way is up in the frame, of length 1; none: not known
};

// x -> scale rotation x + translation, with a proper rotation.
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  static Similarity from_matrix(
      const Eigen::Matrix4d& m);  // Throws Error(input) where the upper 3x3 is not scale times rotation
  Similarity inverse() const;
  Eigen::Vector3d apply(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }
};
Similarity operator*(const Similarity& after, const Similarity& before);

// Moves positions, scales, rotations and spherical harmonics: a camera moved along sees the same picture.
void transform(Gaussians& gaussians, const Similarity& move);
// Near plane, mirror point, detail and up, too, all of it in the world; what comes out is relative to `offset`.
void transform(Scene& scene, const Similarity& move, const Eigen::Vector3d& offset = Eigen::Vector3d::Zero());

// Surfels as volumes: a third scale, `thickness` times the smaller of a surfel's two.
Gaussians thickened(const Gaussians& surfels, double thickness);

// Offsets beyond are refused: in doubles nothing is left of an object there.
inline constexpr double kFarthestOffset = 1e15;

// What the Gaussians of a cube are kept relative to: the world's origin while floats hold the cube's world to 1e-4 of
// its edge, else its centre, so that nothing is lost of a cube that is far away.
Eigen::Vector3d offset_for(const Eigen::Vector3d& centre, double edge);
// A camera of the world, where the scene's Gaussians are.
Camera in_frame(const Scene& scene, const Camera& camera);

// The matrix [2l+1, 2l+1] that turns band `degree` of a function on the sphere: with coefficients c' = D c in the basis
// of 3DGS files, f'(R d) = f(d).
Eigen::MatrixXd sh_rotation(int degree, const Eigen::Matrix3d& rotation);
// That basis, (degree + 1)^2 values at a unit direction, degree 0 to 3.
Eigen::VectorXd sh_basis(int degree, const Eigen::Vector3d& direction);

}  // namespace vsplat

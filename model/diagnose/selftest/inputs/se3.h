// Small motions of a camera.
#pragma once
#include <Eigen/Geometry>
#include <cmath>

namespace vsplat::selftest {

// exp of the rigid motion's generator (omega, tau).
inline Eigen::Matrix4d exp_se3(const Eigen::Matrix<double, 6, 1>& motion) {
  const Eigen::Vector3d omega = motion.head<3>(), tau = motion.tail<3>();
  const double angle = omega.norm();
  Eigen::Matrix3d hat;
  hat << 0, -omega.z(), omega.y(), omega.z(), 0, -omega.x(), -omega.y(), omega.x(), 0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity(), along = Eigen::Matrix3d::Identity();
  if (angle > 0) {
    const double a2 = angle * angle;
    rotation += std::sin(angle) / angle * hat + (1 - std::cos(angle)) / a2 * hat * hat;
    along += (1 - std::cos(angle)) / a2 * hat + (angle - std::sin(angle)) / (a2 * angle) * hat * hat;
  }
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = rotation;
  out.topRightCorner<3, 1>() = along * tau;
  return out;
}

}  // namespace vsplat::selftest

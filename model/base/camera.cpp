#include "model/base/camera.h"

namespace vsplat {

Eigen::Matrix4d Camera::c2w() const {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = w2c.topLeftCorner<3, 3>().transpose();
  out.topRightCorner<3, 1>() = centre();
  return out;
}

Eigen::Vector3d Camera::centre() const { return -w2c.topLeftCorner<3, 3>().transpose() * w2c.topRightCorner<3, 1>(); }

}  // namespace vsplat

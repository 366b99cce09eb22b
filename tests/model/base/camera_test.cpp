#include "model/base/camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace vsplat {
namespace {

TEST(Camera, CameraToWorldIsTheInverse) {
  Camera camera;
  camera.w2c.topLeftCorner<3, 3>() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  camera.w2c.topRightCorner<3, 1>() = Eigen::Vector3d(0.3, -2, 5);
  EXPECT_LT((camera.c2w() - camera.w2c.inverse()).norm(), 1e-12);
  EXPECT_LT((camera.w2c * camera.centre().homogeneous() - Eigen::Vector4d(0, 0, 0, 1)).norm(), 1e-12);
}

}  // namespace
}  // namespace vsplat

// A posed camera with OpenCV axes (x right, y down, z forward), intrinsics in pixels, and pixel centres at +0.5.
#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

namespace vsplat {

// Lens distortion in the models of COLMAP, nerfstudio and OpenCV. Maps undistorted normalised (x, y) to distorted.
// `none` has no parameters; `opencv`: k1 k2 p1 p2 k3 k4 k5 k6 (the rational model, which includes simple radial,
// radial, OPENCV and FULL_OPENCV with zeros); `fisheye`: k1 k2 k3 k4 (theta_d = theta (1 + k1 theta^2 + ...)).
struct Distortion {
  enum class Model { none, opencv, fisheye } model = Model::none;
  double k[8] = {};  // opencv: k1 k2 p1 p2 k3 k4 k5 k6; fisheye: k1 k2 k3 k4
};

struct Camera {
  std::string file;  // the picture's path as listed
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  Eigen::Matrix4d w2c = Eigen::Matrix4d::Identity();
  Distortion distortion;

  Eigen::Matrix4d c2w() const;     // rigid inverse
  Eigen::Vector3d centre() const;  // in world coordinates
};

}  // namespace vsplat

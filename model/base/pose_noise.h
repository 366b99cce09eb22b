// Adds noise to camera poses, to measure its effect, and measures the errors of poses and rays. All in the object's
// frame, whose cube has edges of 1 and is centred at the origin.
#pragma once
#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

// A small motion: rotation in radians about x, y and z, then translation.
using PoseMotion = std::array<double, 6>;

// The matrix exponential of [[w] u; 0 0], a rigid motion.
Eigen::Matrix4d motion_of(const PoseMotion& motion);

// Noise for `count` views: normal with deviation sigma in each component, determined by seed, draw and the object's
// name. The first view has none, because it defines the frame in which results are evaluated.
std::vector<PoseMotion> draw_pose_noise(std::size_t count, double sigma, std::uint64_t seed, std::uint32_t draw,
                                        std::string_view object);

// Applies the motion before world-to-camera: the camera rotates about the object's centre and moves with it.
std::vector<Camera> moved_cameras(std::vector<Camera> cameras, const std::vector<PoseMotion>& noise);
// draw_pose_noise() and moved_cameras() combined.
std::vector<Camera> noisy_cameras(std::vector<Camera> cameras, double sigma, std::uint64_t seed, std::uint32_t draw,
                                  std::string_view object);

// Means over views.
struct PoseErrors {
  double degrees = 0;   // between rotations
  double distance = 0;  // between camera centres
};
PoseErrors pose_errors(const std::vector<Camera>& given, const std::vector<Camera>& accurate);

// The rays through the centres of each camera's t x t patches: unit direction and moment, [t, t, 6] a camera.
std::vector<float> patch_rays(const std::vector<Camera>& cameras, int t, int patch);

// Means over rays of six numbers (direction and moment); each ray is divided by the length of its direction first.
struct RayErrors {
  double degrees = 0;  // between directions
  double moment = 0;   // distance between moments
};
RayErrors ray_errors(const std::vector<float>& predicted, const std::vector<float>& accurate);

}  // namespace vsplat

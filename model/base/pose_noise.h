// Noise on cameras' poses, to measure what it costs, and how far poses and rays then are from the accurate ones. In the
// object's frame, whose cube has edges of 1 and its centre at the origin.
#pragma once
#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

// A small motion: rotation in radians about x, y and z, then translation.
using PoseTwist = std::array<double, 6>;

// The exponential of [[w] u; 0 0], a rigid motion.
Eigen::Matrix4d motion_of(const PoseTwist& twist);

// One for each of `count` views: normal with deviation sigma in each number, by seed, draw and the object's name. The
// first is none: its view defines the frame that results are judged in.
std::vector<PoseTwist> draw_pose_noise(std::size_t count, double sigma, std::uint64_t seed, std::uint32_t draw,
                                       std::string_view object);

// World to camera becomes that after the motion: the camera is turned about the object's centre, and moved with it.
std::vector<Camera> moved_cameras(std::vector<Camera> cameras, const std::vector<PoseTwist>& noise);
// Both in one.
std::vector<Camera> noisy_cameras(std::vector<Camera> cameras, double sigma, std::uint64_t seed, std::uint32_t draw,
                                  std::string_view object);

// Means over views.
struct PoseErrors {
  double degrees = 0;   // between the cameras' rotations
  double distance = 0;  // between their centres
};
PoseErrors pose_errors(const std::vector<Camera>& given, const std::vector<Camera>& accurate);

// Means over rays of six numbers, direction and moment, where either's direction is made unit first and its moment
// divided by the same length.
struct RayErrors {
  double degrees = 0;  // between directions
  double moment = 0;   // distance between moments
};
RayErrors ray_errors(const std::vector<float>& predicted, const std::vector<float>& accurate);

}  // namespace vsplat

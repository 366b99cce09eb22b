#include "model/base/pose_noise.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>

#include "model/base/normal_quantile.h"
#include "model/base/rng.h"

namespace vsplat {
namespace {

constexpr double kDegrees = 57.29577951308232;

double angle_of(double sine, double cosine) { return kDegrees * std::atan2(sine, cosine); }

}  // namespace

Eigen::Matrix4d motion_of(const PoseMotion& motion) {
  const Eigen::Vector3d w(motion[0], motion[1], motion[2]), u(motion[3], motion[4], motion[5]);
  Eigen::Matrix3d k;
  k << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  const double a = w.norm(), a2 = a * a;
  // sin a / a, (1 - cos a) / a^2 and (a - sin a) / a^3; series for small a.
  const bool small = a < 0.05;
  const double first = small ? 1 - a2 / 6 + a2 * a2 / 120 - a2 * a2 * a2 / 5040 : std::sin(a) / a;
  const double second =
      small ? 0.5 - a2 / 24 + a2 * a2 / 720 - a2 * a2 * a2 / 40320 : 2 * std::pow(std::sin(a / 2) / a, 2);
  const double third =
      small ? 1.0 / 6 - a2 / 120 + a2 * a2 / 5040 - a2 * a2 * a2 / 362880 : (a - std::sin(a)) / (a2 * a);
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() += first * k + second * k * k;
  out.topRightCorner<3, 1>() = u + second * k * u + third * k * k * u;
  return out;
}

std::vector<PoseMotion> draw_pose_noise(std::size_t count, double sigma, std::uint64_t seed, std::uint32_t draw,
                                        std::string_view object) {
  std::vector<PoseMotion> out(count, PoseMotion{});
  const std::uint32_t stream = stream_of("pose noise " + std::string(object));
  for (std::size_t view = 1; view < count; ++view)
    for (std::size_t i = 0; i < 6; ++i) {
      const auto block = static_cast<std::uint32_t>(2 * view + i / 4);
      const auto words = philox4x32_10({block, draw, stream, 0}, rng_key(seed));
      out[view][i] = sigma * normal_quantile((words[i % 4] + 0.5) * 0x1p-32);
    }
  return out;
}

std::vector<Camera> moved_cameras(std::vector<Camera> cameras, const std::vector<PoseMotion>& noise) {
  for (std::size_t i = 0; i < std::min(cameras.size(), noise.size()); ++i)
    cameras[i].w2c = cameras[i].w2c * motion_of(noise[i]);
  return cameras;
}

std::vector<Camera> noisy_cameras(std::vector<Camera> cameras, double sigma, std::uint64_t seed, std::uint32_t draw,
                                  std::string_view object) {
  const std::vector<PoseMotion> noise = draw_pose_noise(cameras.size(), sigma, seed, draw, object);
  return moved_cameras(std::move(cameras), noise);
}

PoseErrors pose_errors(const std::vector<Camera>& given, const std::vector<Camera>& accurate) {
  PoseErrors out;
  const auto share = 1 / static_cast<double>(std::max<std::size_t>(1, given.size()));
  for (std::size_t i = 0; i < given.size(); ++i) {
    const Eigen::Matrix3d r = given[i].w2c.topLeftCorner<3, 3>() * accurate[i].w2c.topLeftCorner<3, 3>().transpose();
    const Eigen::Vector3d axis(r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
    out.degrees += share * angle_of(axis.norm(), r.trace() - 1);
    out.distance += share * (given[i].centre() - accurate[i].centre()).norm();
  }
  return out;
}

std::vector<float> patch_rays(const std::vector<Camera>& cameras, int t, int patch) {
  std::vector<float> out;
  for (const Camera& camera : cameras) {
    const Eigen::Matrix4d c2w = camera.c2w();
    const Eigen::Vector3d centre = c2w.topRightCorner<3, 1>();
    for (int y = 0; y < t; ++y)
      for (int x = 0; x < t; ++x) {
        const Eigen::Vector3d towards(((x + 0.5) * patch - camera.cx) / camera.fx,
                                      ((y + 0.5) * patch - camera.cy) / camera.fy, 1);
        const Eigen::Vector3d direction = (c2w.topLeftCorner<3, 3>() * towards).normalized();
        const Eigen::Vector3d moment = centre.cross(direction);
        for (const Eigen::Vector3d& of : {direction, moment})
          for (int i = 0; i < 3; ++i) out.push_back(static_cast<float>(of[i]));
      }
  }
  return out;
}

RayErrors ray_errors(const std::vector<float>& predicted, const std::vector<float>& accurate) {
  RayErrors out;
  const auto share = 6 / static_cast<double>(std::max<std::size_t>(6, accurate.size()));
  const auto part = [](const std::vector<float>& from, std::size_t at) {
    return Eigen::Vector3f(from[at], from[at + 1], from[at + 2]).cast<double>().eval();
  };
  for (std::size_t i = 0; i + 5 < accurate.size(); i += 6) {
    const Eigen::Vector3d d = part(predicted, i), e = part(accurate, i);
    out.degrees += share * angle_of(d.cross(e).norm(), d.dot(e));
    out.moment += share * (part(predicted, i + 3) / d.norm() - part(accurate, i + 3) / e.norm()).norm();
  }
  return out;
}

}  // namespace vsplat

#include "model/cameras/orbit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>

#include "model/base/gaussians.h"
#include "model/base/statistics.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr int max_orbit = 9999;

// Any unit vector across `axis`.
Vector3d across(const Vector3d& axis) {
  int least = 0;
  axis.cwiseAbs().minCoeff(&least);
  return axis.cross(Vector3d::Unit(least)).normalized();
}

struct Circle {
  Vector3d centre, up, start;  // start: across up, the azimuth of the first camera
  double radius = 1, elevation = 0, fov = 1;
};

std::vector<Camera> cameras_on(const Circle& circle, int count, int width, int height) {
  if (count < 1 || count > max_orbit)
    fail(Status::usage, "an orbit of {} cameras; 1 to {} are possible", count, max_orbit);
  if (width < 1 || height < 1) fail(Status::usage, "pictures of {} x {} pixels are not possible", width, height);
  const double focal = 0.5 * std::min(width, height) / std::tan(0.5 * circle.fov);
  const Vector3d side = circle.up.cross(circle.start);
  std::vector<Camera> out;
  out.reserve(count);
  for (int i = 0; i < count; ++i) {
    const double azimuth = 2 * M_PI * i / count;
    const Vector3d level = std::cos(azimuth) * circle.start + std::sin(azimuth) * side;
    const Vector3d away = std::cos(circle.elevation) * level + std::sin(circle.elevation) * circle.up;
    Camera c;
    c.file = fmt::format("{:04d}.png", i);
    c.width = width, c.height = height;
    c.fx = c.fy = focal;
    c.cx = 0.5 * width, c.cy = 0.5 * height;
    // At the pole the picture's upper side turns with the azimuth.
    c.w2c = look_at(circle.centre + circle.radius * away, circle.centre,
                    std::cos(circle.elevation) * circle.up - std::sin(circle.elevation) * level);
    out.push_back(c);
  }
  return out;
}

void apply(const OrbitOptions& options, Circle& circle) {
  if (options.radius) {
    if (!(*options.radius > 0) || !std::isfinite(*options.radius))
      fail(Status::usage, "vsplat_orbit_options.radius is {}, a positive number is expected", *options.radius);
    circle.radius = *options.radius;
  }
  if (options.elevation_deg) {
    if (!(std::abs(*options.elevation_deg) <= 90))
      fail(Status::usage, "vsplat_orbit_options.elevation is {}, -90 to 90 degrees are expected",
           *options.elevation_deg);
    circle.elevation = *options.elevation_deg * M_PI / 180;
  }
}

std::optional<Vector3d> asked_up(const OrbitOptions& options) {
  if (!options.up) return std::nullopt;
  const double length = options.up->norm();
  if (!(length > 1e-12) || !std::isfinite(length))
    fail(Status::usage, "vsplat_orbit_options.up is no direction: three numbers, not all 0, are expected");
  return *options.up / length;
}

}  // namespace

Eigen::Matrix4d look_at(const Vector3d& eye, const Vector3d& target, const Vector3d& up) {
  Vector3d forward = target - eye;
  forward = forward.norm() > 0 ? forward.normalized() : across(up.normalized());
  Vector3d right = forward.cross(up.normalized());
  right = right.norm() > 1e-9 ? right.normalized() : across(forward);
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.row(0).head<3>() = right;
  out.row(1).head<3>() = forward.cross(right);
  out.row(2).head<3>() = forward;
  out.topRightCorner<3, 1>() = -(out.topLeftCorner<3, 3>() * eye);
  return out;
}

// Minimises the weighted mean of (up . x_i)^2 + 0.001 |up - m|^2, m the mean of the -y axes: exact for cameras that are
// not rolled, whatever their elevations and however little of the circle they cover; where their x axes leave it open,
// m says.
Vector3d up_axis(std::span<const Camera> cameras) {
  Vector3d mean = Vector3d::Zero(), centre = Vector3d::Zero();
  for (const Camera& c : cameras) {
    mean -= c.w2c.row(1).head<3>().transpose();
    centre += c.centre();
  }
  const auto n = static_cast<double>(cameras.size());
  mean /= n, centre /= n;
  if (mean.norm() < 0.05) {  // rolled every way: across the plane the cameras are in
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Camera& c : cameras) spread += (c.centre() - centre) * (c.centre() - centre).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(spread);
    const Vector3d normal = eigen.eigenvectors().col(0);
    return normal.dot(mean) < 0 ? Vector3d(-normal) : normal;
  }
  Vector3d up = mean.normalized();
  const Vector3d prior = up;
  for (int step = 0; step < 10; ++step) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    double total = 0;
    for (const Camera& c : cameras) {
      const Vector3d x = c.w2c.row(0).head<3>();
      const double weight = 1 / std::max(0.05, std::abs(up.dot(x)));  // one turned by a quarter counts little
      A += weight * x * x.transpose();
      total += weight;
    }
    A /= total;
    A.diagonal().array() += 0.001;
    up = A.ldlt().solve(prior).normalized();
  }
  return up;
}

std::vector<Camera> orbit_about(std::span<const Camera> inputs, const Vector3d& centre, int count, int width,
                                int height, const OrbitOptions& options) {
  if (inputs.empty()) fail(Status::usage, "no camera to take the orbit from");
  Circle circle;
  circle.centre = centre;
  circle.up = asked_up(options).value_or(up_axis(inputs));
  std::vector<double> distances, elevations, fovs;
  for (const Camera& c : inputs) {
    const Vector3d away = c.centre() - centre;
    distances.push_back(away.norm());
    if (away.norm() > 0) elevations.push_back(std::asin(std::clamp(circle.up.dot(away.normalized()), -1.0, 1.0)));
    fovs.push_back(2 * std::atan(0.5 * std::min(c.width / c.fx, c.height / c.fy)));
  }
  circle.radius = median(distances);
  circle.elevation = elevations.empty() ? 0 : median(elevations);
  circle.fov = median(fovs);
  apply(options, circle);
  if (!(circle.radius > 0))
    fail(Status::input, "the cameras are at the object's centre {}, {}, {}: give vsplat_orbit_options.radius",
         centre.x(), centre.y(), centre.z());
  Vector3d start = inputs[0].centre() - centre;
  start -= start.dot(circle.up) * circle.up;
  circle.start = start.norm() > 1e-6 * circle.radius ? start.normalized() : across(circle.up);
  return cameras_on(circle, count, width, height);
}

std::vector<Camera> orbit_about_scene(const Gaussians& scene, int count, int width, int height,
                                      const OrbitOptions& options) {
  std::vector<Vector3d> means;
  for (std::size_t i = 0; i < scene.count; ++i) {
    const Vector3d mean(scene.means[3 * i], scene.means[3 * i + 1], scene.means[3 * i + 2]);
    if (mean.allFinite()) means.push_back(mean);
  }
  Circle circle;
  circle.centre.setZero();
  circle.fov = 50 * M_PI / 180;
  circle.up = asked_up(options).value_or(Vector3d(0, -1, 0));
  if (!means.empty()) {
    std::vector<double> values(means.size());
    for (int axis = 0; axis < 3; ++axis) {
      std::transform(means.begin(), means.end(), values.begin(), [&](const Vector3d& m) { return m[axis]; });
      circle.centre[axis] = median(values);
    }
    std::transform(means.begin(), means.end(), values.begin(),
                   [&](const Vector3d& m) { return (m - circle.centre).norm(); });
    const double reach = quantile(values, 0.95);
    constexpr double room = 1.1;  // for the Gaussians' own extent
    circle.radius = reach > 0 ? room * reach / std::sin(0.5 * circle.fov) : 1.0;
  }
  apply(options, circle);
  const Vector3d front = Vector3d(0, 0, -1) + circle.up.z() * circle.up;  // -z without its part along up
  circle.start = front.norm() > 1e-6 ? front.normalized() : across(circle.up);
  return cameras_on(circle, count, width, height);
}

}  // namespace vsplat

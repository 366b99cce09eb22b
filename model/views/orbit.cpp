#include "model/views/orbit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "model/base/scene.h"
#include "model/base/statistics.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr int max_orbit = 9999;
constexpr double filled = 0.9;  // of the picture: a margin of a twentieth on each side

// A unit vector perpendicular to `axis`.
Vector3d across(const Vector3d& axis) {
  int least = 0;
  axis.cwiseAbs().minCoeff(&least);
  return axis.cross(Vector3d::Unit(least)).normalized();
}

struct Circle {
  Vector3d centre, up, start;  // start: perpendicular to up; azimuth of the first camera
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
    // Near the pole the picture's upper side follows the azimuth.
    c.w2c = look_at(circle.centre + circle.radius * away, circle.centre,
                    std::cos(circle.elevation) * circle.up - std::sin(circle.elevation) * level);
    out.push_back(c);
  }
  return out;
}

void apply(const OrbitOptions& options, Circle& circle) {
  if (options.radius) {
    if (!(*options.radius > 0) || !std::isfinite(*options.radius))
      fail(Status::usage, "{} is {}, a positive number is expected", Option::orbit_radius, *options.radius);
    circle.radius = *options.radius;
  }
  if (options.elevation_deg) {
    if (!(std::abs(*options.elevation_deg) <= 90))
      fail(Status::usage, "{} is {}, -90 to 90 degrees are expected", Option::orbit_elevation, *options.elevation_deg);
    circle.elevation = *options.elevation_deg * M_PI / 180;
  }
}

std::optional<Vector3d> asked_up(const OrbitOptions& options) {
  if (!options.up) return std::nullopt;
  const double length = options.up->norm();
  if (!(length > 1e-12) || !std::isfinite(length))
    fail(Status::usage, "{} is no direction: three numbers, not all 0, are expected", Option::up);
  return *options.up / length;
}

// The field of view that contains the cylinder inscribed in a cube, from a camera on the circle.
double view_of_cube(double edge, double radius, double elevation) {
  const double half = 0.5 * edge, sine = std::sin(elevation), cosine = std::cos(elevation);
  double tangent = 0;
  for (const double h : {-half, half})
    for (const double r : {-half, half})
      tangent =
          std::max(tangent, std::abs(h * cosine - r * sine) / std::max(radius - h * sine - r * cosine, 0.1 * radius));
  return 2 * std::atan(tangent / filled);
}

// The bounding sphere of a Gaussian, for framing.
struct Ball {
  Vector3d mean;
  double radius;
};

std::vector<Ball> visible_balls(const Gaussians& g) {
  constexpr float seen = 0.1f;
  constexpr double deviations = 2;
  const auto axes = static_cast<std::size_t>(scales_of(g.kind));
  std::vector<Ball> out;
  for (const float least : {seen, 0.0f}) {
    for (std::size_t i = 0; i < g.count; ++i) {
      const Vector3d mean(g.means[3 * i], g.means[3 * i + 1], g.means[3 * i + 2]);
      const float* s = &g.scales[axes * i];
      if (mean.allFinite() && g.opacities[i] >= least)
        out.push_back({mean, deviations * *std::max_element(s, s + axes)});
    }
    if (!out.empty()) break;
  }
  return out;
}

constexpr double far_off = 10;  // times the median distance from the middle

Vector3d median_of(const std::vector<Ball>& balls) {
  std::vector<Vector3d> means;
  means.reserve(balls.size());
  for (const Ball& b : balls) means.push_back(b.mean);
  return median(means);
}

// Removes a sky, as a fit writes it: a sphere of most of the balls, far around the others. One of fewer balls counts as
// floaters.
std::vector<Ball> without_sky(std::vector<Ball> balls) {
  constexpr double thickness = 0.1;
  const Vector3d middle = median_of(balls);
  std::vector<double> distances, inside;
  for (const Ball& b : balls) distances.push_back((b.mean - middle).norm());
  const double radius = median(distances), inner = (1 - thickness) * radius, outer = (1 + thickness) * radius;
  std::copy_if(distances.begin(), distances.end(), std::back_inserter(inside), [&](double d) { return d < inner; });
  const auto shell = static_cast<std::size_t>(
      std::count_if(distances.begin(), distances.end(), [&](double d) { return d >= inner && d <= outer; }));
  if (2 * shell < balls.size() || inside.empty() || far_off * median(inside) > radius) return balls;
  std::erase_if(balls, [&](const Ball& b) { return (b.mean - middle).norm() >= inner; });
  return balls;
}

// Removes balls far from the others, if they are more than middle_of() and distance_for() ignore by themselves.
std::vector<Ball> without_floaters(std::vector<Ball> balls) {
  constexpr double few = 0.02;
  const Vector3d middle = median_of(balls);
  std::vector<double> distances;
  distances.reserve(balls.size());
  for (const Ball& b : balls) distances.push_back((b.mean - middle).norm());
  const double most = far_off * median(distances);
  const auto is_far = [&](const Ball& b) { return (b.mean - middle).norm() > most; };
  const std::size_t all = balls.size();
  const auto floaters = static_cast<std::size_t>(std::count_if(balls.begin(), balls.end(), is_far));
  if (!(most > 0) || static_cast<double>(floaters) <= few * static_cast<double>(all)) return balls;
  std::erase_if(balls, is_far);
  warn(
      "{} of {} visible Gaussians lie more than {:.3g} from the scene's middle, 10 times as far as most: the orbit "
      "goes around the others",
      floaters, all, most);
  return balls;
}

Vector3d up_of(const Scene& scene) {
  return scene.up ? Vector3d((*scene.up)[0], (*scene.up)[1], (*scene.up)[2]).normalized() : Vector3d(0, -1, 0);
}

// Perpendicular to up: the front of the nearer of the worlds with up +y (front +z) and -y (front -z), rotated the
// shortest way. For z-up worlds, halfway between, both give -y.
Vector3d front_of(const Vector3d& up) {
  const double side = up.y() > 0 ? 1 : -1;
  return (Eigen::Quaterniond::FromTwoVectors(Vector3d(0, side, 0), up) * Vector3d(0, 0, side)).normalized();
}

Vector3d middle_of(const std::vector<Ball>& balls, const Circle& circle) {
  constexpr double strays = 0.02;
  std::vector<double> values(balls.size());
  Vector3d out = Vector3d::Zero();
  for (const Vector3d& axis : {circle.up, circle.start, Vector3d(circle.up.cross(circle.start))}) {
    std::transform(balls.begin(), balls.end(), values.begin(), [&](const Ball& b) { return axis.dot(b.mean); });
    out += 0.5 * (quantile(values, strays) + quantile(values, 1 - strays)) * axis;
  }
  return out;
}

// The distance from which the balls stay inside `filled` of the picture along the whole circle.
double distance_for(const std::vector<Ball>& balls, const Circle& circle, int width, int height) {
  std::vector<double> distances(balls.size());
  std::transform(balls.begin(), balls.end(), distances.begin(),
                 [&](const Ball& b) { return (b.mean - circle.centre).norm(); });
  const double most = 1.3 * quantile(distances, 0.95);
  const double side = std::min(width, height), tangent = filled * std::tan(0.5 * circle.fov);
  const double across = tangent * width / side, along = tangent * height / side;
  const double sine = std::sin(circle.elevation), cosine = std::cos(circle.elevation);
  double out = 0;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    if (distances[i] > most) continue;
    const Vector3d off = balls[i].mean - circle.centre;
    const double radius = std::min(balls[i].radius, 0.25 * most), height_over = off.dot(circle.up);
    const double turning = (off - height_over * circle.up).norm() + radius;
    for (const double h : {height_over - radius, height_over + radius}) {
      out = std::max(out, h * sine + turning * std::hypot(1 / across, cosine));  // at the side
      for (const double r : {-turning, turning})                                 // nearest and farthest
        out = std::max(out, std::abs(h * cosine - r * sine) / along + h * sine + r * cosine);
    }
  }
  return out > 0 ? out : 1;
}

// A level circle about the visible part of the scene, without a radius, and that part.
std::pair<Circle, std::vector<Ball>> circle_about(const Scene& scene, const OrbitOptions& options) {
  Circle circle;
  circle.centre.setZero();
  circle.fov = 50 * M_PI / 180;
  circle.up = asked_up(options).value_or(up_of(scene));
  circle.start = front_of(circle.up);
  std::vector<Ball> balls = visible_balls(scene.gaussians);
  if (!balls.empty()) {
    balls = without_floaters(without_sky(std::move(balls)));
    circle.centre = middle_of(balls, circle);
  }
  return {circle, std::move(balls)};
}

std::vector<Camera> cameras_about(const Scene& scene, const std::vector<Ball>& balls, Circle circle, int count,
                                  int width, int height, const OrbitOptions& options) {
  apply(options, circle);  // sets the elevation, on which the distance depends
  if (!balls.empty()) circle.radius = distance_for(balls, circle, width, height);
  apply(options, circle);
  if (!scene.offset.isZero(0)) circle.centre += scene.offset;
  return cameras_on(circle, count, width, height);
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

// Minimises the weighted mean of (up . x_i)^2 + 0.001 |up - m|^2, where m is the mean of the -y axes. Exact for cameras
// without roll, whatever their elevations and however little of the circle they cover; m decides if the x axes do not
// determine it.
Vector3d up_axis(std::span<const Camera> cameras) {
  Vector3d mean = Vector3d::Zero(), centre = Vector3d::Zero();
  for (const Camera& c : cameras) {
    mean -= c.w2c.row(1).head<3>().transpose();
    centre += c.centre();
  }
  const auto n = static_cast<double>(cameras.size());
  mean /= n, centre /= n;
  if (mean.norm() < 0.05) {  // all kinds of roll: normal of the plane of the cameras
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
      const double weight = 1 / std::max(0.05, std::abs(up.dot(x)));  // a camera rolled by 90 degrees counts little
      A += weight * x * x.transpose();
      total += weight;
    }
    A /= total;
    A.diagonal().array() += 0.001;
    up = A.ldlt().solve(prior).normalized();
  }
  return up;
}

Vector3d world_up(std::span<const Camera> cameras) {
  const Vector3d up = up_axis(cameras);
  double rolls = 0;
  for (const Camera& c : cameras) {
    const double roll = std::asin(std::clamp(up.dot(c.w2c.row(0).head<3>().transpose()), -1.0, 1.0));
    rolls += roll * roll / static_cast<double>(cameras.size());
  }
  constexpr double degree = M_PI / 180;
  int axis = 0;
  up.cwiseAbs().maxCoeff(&axis);
  Vector3d nearest = Vector3d::Zero();
  nearest[axis] = std::copysign(1.0, up[axis]);
  const double off = std::acos(std::clamp(up.dot(nearest), -1.0, 1.0));
  return off <= std::clamp(std::sqrt(rolls), 3 * degree, 30 * degree) ? nearest : up;
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
  const double usual = circle.radius;  // a requested radius is meant to change what is visible
  apply(options, circle);
  if (options.edge > 0) circle.fov = std::max(circle.fov, view_of_cube(options.edge, usual, circle.elevation));
  if (!(circle.radius > 0))
    fail(Status::input, "the cameras are at the object's centre {}, {}, {}: give {}", centre.x(), centre.y(),
         centre.z(), Option::orbit_radius);
  Vector3d start = inputs[0].centre() - centre;
  start -= start.dot(circle.up) * circle.up;
  circle.start = start.norm() > 1e-6 * circle.radius ? start.normalized() : across(circle.up);
  return cameras_on(circle, count, width, height);
}

std::vector<Camera> orbit_about_scene(const Scene& scene, int count, int width, int height,
                                      const OrbitOptions& options) {
  const auto [circle, balls] = circle_about(scene, options);
  return cameras_about(scene, balls, circle, count, width, height, options);
}

std::vector<Camera> rings_about_scene(const Scene& scene, std::span<const Ring> rings, int width, int height) {
  const auto [circle, balls] = circle_about(scene, {});
  std::vector<Camera> out;
  for (const Ring& ring : rings) {
    OrbitOptions options;
    options.elevation_deg = ring.elevation_deg;
    const std::vector<Camera> cameras = cameras_about(scene, balls, circle, ring.count, width, height, options);
    out.insert(out.end(), cameras.begin(), cameras.end());
  }
  return out;
}

}  // namespace vsplat

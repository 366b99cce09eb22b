#include "model/data/sphere_cameras.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "model/data/random.h"
#include "model/views/orbit.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr int max_cameras = 9999, min_size = 8, max_size = 8192;
constexpr double fov = 0.857556, nearest = 1.6, spread = 0.3;
constexpr double margin = 1.02;  // so that the object does not touch a picture's edge

}  // namespace

std::vector<Camera> sphere_cameras(int count, int size, double radius, std::uint64_t seed, std::uint32_t object) {
  if (count < 1 || count > max_cameras)
    fail(Status::usage, "{} views of an object; 1 to {} are possible", count, max_cameras);
  if (size < min_size || size > max_size)
    fail(Status::usage, "pictures of {} pixels to a side; {} to {} are possible", size, min_size, max_size);
  Random random(seed, object, camera_stream);
  const double golden = M_PI * (3 - std::sqrt(5.0)), turn = random.uniform(0, 2 * M_PI);
  const double jitter = 0.3 * std::sqrt(4 * M_PI / count);  // of the distance between neighbours
  const double closest = std::max(nearest, margin * radius / std::sin(0.5 * fov));
  std::vector<Camera> out;
  out.reserve(count);
  for (int i = 0; i < count; ++i) {
    const double height = 1 - (2 * i + 1.0) / count, level = std::sqrt(1 - height * height);
    const double azimuth = turn + golden * i;
    Vector3d away(level * std::cos(azimuth), height, level * std::sin(azimuth));
    for (double& v : away) v += random.uniform(-jitter, jitter);
    if (!(away.norm() > 1e-3)) away = Vector3d(0, 0, 1);
    const double distance = closest + random.uniform(0, spread);
    Camera c;
    c.file = fmt::format("images/{:04d}.png", i);
    c.width = c.height = size;
    c.fx = c.fy = 0.5 * size / std::tan(0.5 * fov);
    c.cx = c.cy = 0.5 * size;
    c.w2c = look_at(distance * away.normalized(), Vector3d::Zero(), Vector3d(0, 1, 0));
    out.push_back(c);
  }
  return out;
}

}  // namespace vsplat

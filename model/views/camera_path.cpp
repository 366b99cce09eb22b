#include "model/views/camera_path.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "runtime/fail.h"

namespace vsplat {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
// The interpolated coordinates in a vector space: the centre, or the position in camera coordinates of the common
// target as x/z, y/z, log z; then log fx/w, log fy/h, cx/w, cy/h.
using Linear = Eigen::Matrix<double, 7, 1>;

struct Key {
  Linear at;
  Quaterniond turn;  // camera to world
};

// The interval between two keys. Velocities are per unit of path time; rotation is about the camera's own axes.
struct Stretch {
  double start = 0, time = 1;
  Linear step;
  Vector3d turn;
};

Vector3d log_of(const Quaterniond& q) {
  const double length = q.vec().norm();
  if (length == 0) return Vector3d::Zero();
  const double angle = 2 * std::atan2(length, std::abs(q.w()));
  Vector3d axis = q.vec() / length;
  if (std::abs(q.w()) > 1e-9) return (q.w() < 0 ? -angle : angle) * axis;
  int largest = 0;  // half a turn: both arcs have the same length
  axis.cwiseAbs().maxCoeff(&largest);
  return (axis[largest] < 0 ? -angle : angle) * axis;
}

Quaterniond exp_of(const Vector3d& turn) {
  const double angle = turn.norm();
  return angle > 0 ? Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) : Quaterniond::Identity();
}

Vector3d axis_of(const Camera& c) { return c.w2c.row(2).head<3>(); }
Vector3d in_camera(const Camera& c, const Vector3d& point) {
  return c.w2c.topLeftCorner<3, 3>() * point + c.w2c.topRightCorner<3, 1>();
}

bool sees(const Camera& c, const Vector3d& point) {
  const Vector3d at = in_camera(c, point);
  if (!(at.z() > 0)) return false;
  const double u = c.fx * at.x() / at.z() + c.cx, v = c.fy * at.y() / at.z() + c.cy;
  return u >= 0 && u <= c.width && v >= 0 && v <= c.height;
}

// The point nearest to all optical axes, if every key has it in its picture. The axes of cameras that face each other
// leave the position along them undetermined; a small regulariser pulls it to the mean of the camera centres, which
// lies between such cameras, and beside cameras that look in the same direction.
std::optional<Vector3d> point_looked_at(std::span<const Camera> keys) {
  constexpr double pull = 1e-4;
  Vector3d middle = Vector3d::Zero(), right = Vector3d::Zero();
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
  const double share = 1 / static_cast<double>(keys.size());
  for (const Camera& c : keys) {
    const Eigen::Matrix3d off = Eigen::Matrix3d::Identity() - axis_of(c) * axis_of(c).transpose();
    middle += share * c.centre();
    across += share * off;
    right += share * off * c.centre();
  }
  across.diagonal().array() += pull;
  const Vector3d point = across.ldlt().solve(right + pull * middle);
  const bool seen = std::all_of(keys.begin(), keys.end(), [&](const Camera& c) { return sees(c, point); });
  return seen ? std::optional(point) : std::nullopt;
}

Key key_of(const Camera& c, const std::optional<Vector3d>& target) {
  Key out;
  const Vector3d at = target ? in_camera(c, *target) : c.centre();
  const Vector3d place = target ? Vector3d(at.x() / at.z(), at.y() / at.z(), std::log(at.z())) : at;
  out.at << place, std::log(c.fx / c.width), std::log(c.fy / c.height), c.cx / c.width, c.cy / c.height;
  out.turn = Quaterniond(Eigen::Matrix3d(c.w2c.topLeftCorner<3, 3>().transpose())).normalized();
  return out;
}

void check_shapes(std::span<const Camera> keys) {
  const Camera& first = keys.front();
  for (std::size_t i = 1; i < keys.size(); ++i) {
    const double scaled = static_cast<double>(keys[i].height) * first.width / keys[i].width;
    if (std::abs(scaled - first.height) > 1)  // another resolution of the same picture is rounded to whole pixels
      fail(Status::input,
           "key camera {} has pictures of {} x {} pixels, the first one of {} x {}: a path's cameras need the same "
           "proportions",
           i, keys[i].width, keys[i].height, first.width, first.height);
  }
}

std::vector<Stretch> stretches_of(const std::vector<Key>& keys, std::span<const Camera> cameras) {
  std::vector<Stretch> out(keys.size() - 1);
  double mean = 0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].step = keys[i + 1].at - keys[i].at;
    out[i].turn = log_of(keys[i].turn.conjugate() * keys[i + 1].turn);
    out[i].time = std::sqrt((cameras[i + 1].centre() - cameras[i].centre()).norm());
    mean += out[i].time / static_cast<double>(out.size());
  }
  double start = 0;
  for (Stretch& s : out) {
    s.time = mean > 0 ? std::max(s.time / mean, 0.25) : 1;
    s.start = start;
    start += s.time;
  }
  return out;
}

// The velocity at key `i`: that of the parabola through it and its neighbours; at the ends, that of the only adjacent
// interval.
template <class V>
V velocity(const std::vector<Stretch>& all, std::size_t i, V Stretch::*way) {
  const auto mean = [&](std::size_t k) -> V { return all[k].*way / all[k].time; };
  if (i == 0) return mean(0);
  if (i == all.size()) return mean(i - 1);
  const double before = all[i - 1].time, after = all[i].time;
  return (after * mean(i - 1) + before * mean(i)) / (before + after);
}

// Cubic Bezier curve of interval `i` at u in [0,1], in the cumulative form that generalises to rotations. Its control
// points are a third of the interval's time along the velocities at its ends.
Key on_stretch(const std::vector<Key>& keys, const std::vector<Stretch>& all, std::size_t i, double u) {
  const double third = all[i].time / 3, v = 1 - u;
  const double b1 = 1 - v * v * v, b2 = u * u * (3 - 2 * u), b3 = u * u * u;
  const Linear first = third * velocity(all, i, &Stretch::step), last = third * velocity(all, i + 1, &Stretch::step);
  const Vector3d turn = third * velocity(all, i, &Stretch::turn), stop = third * velocity(all, i + 1, &Stretch::turn);
  const Quaterniond from = keys[i].turn * exp_of(turn), to = keys[i + 1].turn * exp_of(-stop);
  const Vector3d middle = log_of(from.conjugate() * to);
  Key out;
  out.at = keys[i].at + b1 * first + b2 * (all[i].step - first - last) + b3 * last;
  out.turn = (keys[i].turn * exp_of(b1 * turn) * exp_of(b2 * middle) * exp_of(b3 * stop)).normalized();
  return out;
}

Camera camera_of(const Key& key, const Camera& like, const std::optional<Vector3d>& target) {
  Camera out = like;
  Vector3d centre = key.at.head<3>();
  if (target) {
    const Vector3d seen = std::exp(key.at[2]) * Vector3d(key.at[0], key.at[1], 1);
    centre = *target - key.turn * seen;
  }
  out.fx = std::exp(key.at[3]) * like.width, out.fy = std::exp(key.at[4]) * like.height;
  out.cx = key.at[5] * like.width, out.cy = key.at[6] * like.height;
  out.w2c.topLeftCorner<3, 3>() = key.turn.conjugate().toRotationMatrix();
  out.w2c.topRightCorner<3, 1>() = -out.w2c.topLeftCorner<3, 3>() * centre;
  return out;
}

// The key itself at the first key's size.
Camera resized(Camera key, const Camera& like) {
  if (key.width != like.width || key.height != like.height) {
    const double x = static_cast<double>(like.width) / key.width, y = static_cast<double>(like.height) / key.height;
    key.fx *= x, key.cx *= x, key.fy *= y, key.cy *= y;
    key.width = like.width, key.height = like.height;
  }
  return key;
}

}  // namespace

std::vector<Camera> camera_path(std::span<const Camera> cameras, int count) {
  if (cameras.empty()) fail(Status::usage, "a path needs at least one key camera");
  if (count < 1 || count > max_path) fail(Status::usage, "a path of {} cameras; 1 to {} are possible", count, max_path);
  check_shapes(cameras);
  const std::optional<Vector3d> target = point_looked_at(cameras);
  std::vector<Key> keys;
  keys.reserve(cameras.size());
  for (const Camera& c : cameras) keys.push_back(key_of(c, target));
  const std::vector<Stretch> all = stretches_of(keys, cameras);
  std::vector<Camera> out;
  out.reserve(static_cast<std::size_t>(count));
  std::size_t i = 0;
  for (int n = 0; n < count; ++n) {
    if (n == 0 || all.empty()) {
      out.push_back(cameras.front());
    } else if (n + 1 == count) {
      out.push_back(resized(cameras.back(), cameras.front()));
    } else {
      const double now = (all.back().start + all.back().time) * n / (count - 1);
      while (i + 1 < all.size() && now >= all[i + 1].start) ++i;
      out.push_back(camera_of(on_stretch(keys, all, i, (now - all[i].start) / all[i].time), cameras.front(), target));
    }
    out.back().file = fmt::format("{:04d}.png", n);
    out.back().distortion = {};
  }
  return out;
}

}  // namespace vsplat

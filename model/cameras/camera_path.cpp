#include "model/cameras/camera_path.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "runtime/fail.h"

namespace vsplat {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
// What moves in a vector space: the centre, log fx/w, log fy/h, cx/w, cy/h.
using Linear = Eigen::Matrix<double, 7, 1>;

struct Key {
  Linear at;
  Quaterniond turn;  // camera to world
};

// From one key to the next; velocities are per unit of the path's time, turning about the camera's own axes.
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
  int largest = 0;  // half a turn: both arcs are as short
  axis.cwiseAbs().maxCoeff(&largest);
  return (axis[largest] < 0 ? -angle : angle) * axis;
}

Quaterniond exp_of(const Vector3d& turn) {
  const double angle = turn.norm();
  return angle > 0 ? Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) : Quaterniond::Identity();
}

Key key_of(const Camera& c) {
  Key out;
  out.at << c.centre(), std::log(c.fx / c.width), std::log(c.fy / c.height), c.cx / c.width, c.cy / c.height;
  out.turn = Quaterniond(Eigen::Matrix3d(c.w2c.topLeftCorner<3, 3>().transpose())).normalized();
  return out;
}

void check_shapes(std::span<const Camera> keys) {
  const Camera& first = keys.front();
  for (std::size_t i = 1; i < keys.size(); ++i) {
    const double scaled = static_cast<double>(keys[i].height) * first.width / keys[i].width;
    if (std::abs(scaled - first.height) > 1)  // the same picture at another resolution is rounded to whole pixels
      fail(Status::input,
           "key camera {} has pictures of {} x {} pixels, the first one of {} x {}: a path's cameras need the same "
           "proportions",
           i, keys[i].width, keys[i].height, first.width, first.height);
  }
}

std::vector<Stretch> stretches_of(const std::vector<Key>& keys) {
  std::vector<Stretch> out(keys.size() - 1);
  double mean = 0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].step = keys[i + 1].at - keys[i].at;
    out[i].turn = log_of(keys[i].turn.conjugate() * keys[i + 1].turn);
    out[i].time = std::sqrt(out[i].step.head<3>().norm());
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

// The velocity at key `i`: of the parabola through it and its neighbours; at the ends that of the one stretch there.
template <class V>
V velocity(const std::vector<Stretch>& all, std::size_t i, V Stretch::*way) {
  const auto mean = [&](std::size_t k) -> V { return all[k].*way / all[k].time; };
  if (i == 0) return mean(0);
  if (i == all.size()) return mean(i - 1);
  const double before = all[i - 1].time, after = all[i].time;
  return (after * mean(i - 1) + before * mean(i)) / (before + after);
}

// Bezier's cubic of stretch `i` at u in [0,1], in the sum of steps that carries over to rotations: its control points
// are a third of the stretch's time along the velocities at its ends.
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

Camera camera_of(const Key& key, const Camera& like) {
  Camera out = like;
  out.fx = std::exp(key.at[3]) * like.width, out.fy = std::exp(key.at[4]) * like.height;
  out.cx = key.at[5] * like.width, out.cy = key.at[6] * like.height;
  out.w2c.topLeftCorner<3, 3>() = key.turn.conjugate().toRotationMatrix();
  out.w2c.topRightCorner<3, 1>() = -out.w2c.topLeftCorner<3, 3>() * key.at.head<3>();
  return out;
}

// A key as it is, in the first one's size.
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
  std::vector<Key> keys;
  keys.reserve(cameras.size());
  for (const Camera& c : cameras) keys.push_back(key_of(c));
  const std::vector<Stretch> all = stretches_of(keys);
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
      out.push_back(camera_of(on_stretch(keys, all, i, (now - all[i].start) / all[i].time), cameras.front()));
    }
    out.back().file = fmt::format("{:04d}.png", n);
    out.back().distortion = {};
  }
  return out;
}

}  // namespace vsplat

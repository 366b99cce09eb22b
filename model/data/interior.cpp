#include "model/data/interior.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/base/resample.h"
#include "model/data/bodies.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kNearest = 0.7, kFarthest = 5, kOutside = 8;
constexpr int kSamples = 2;  // in each direction of a pixel

// Linear colour at (u, v) in [0,1] of the wall.
Vector3f painted(const Paint& paint, const Eigen::Vector2f& uv) {
  if (paint.gradient)
    return gradient_colour(paint, 1 + 2 * paint.along.head<2>().dot(uv - Eigen::Vector2f(0.5f, 0.5f)));
  if (!paint.material.texture) return paint.material.colour;
  const Eigen::Vector2f there = paint.begins + paint.repeats.cwiseProduct(uv);
  return paint.material.colour.cwiseProduct(sample(*paint.material.texture, there));
}

// The point where a ray leaves the box with half edges `half`, in the box's axes.
struct Exit {
  bool met = false;
  int wall = 0;
  Vector3d at = Vector3d::Zero();
};
Exit exit_of(const Vector3d& half, const Vector3d& origin, const Vector3d& direction) {
  Exit out;
  double enters = 0, leaves = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double d = direction[axis];
    if (d == 0) {
      if (std::abs(origin[axis]) > half[axis]) return out;
      continue;
    }
    const double far = ((d > 0 ? half[axis] : -half[axis]) - origin[axis]) / d;
    enters = std::max(enters, ((d > 0 ? -half[axis] : half[axis]) - origin[axis]) / d);
    if (far < leaves) leaves = far, out.wall = 2 * axis + (d > 0 ? 1 : 0);
  }
  out.met = leaves > enters && std::isfinite(leaves);
  out.at = out.met ? Vector3d(origin + leaves * direction) : Vector3d::Zero();
  return out;
}

Vector3f linear_wall_colour(const Room& room, const Vector3d& origin, const Vector3d& direction) {
  const Vector3d from = room.turn * origin, along = room.turn * direction;
  for (const double scale : {1.0, kOutside}) {
    const Vector3d half = scale * room.half;
    const Exit exit = exit_of(half, from, along);
    if (!exit.met) continue;
    const int axis = exit.wall / 2, across = (axis + 1) % 3, up = (axis + 2) % 3;
    const Eigen::Vector2d uv(exit.at[across] / half[across], exit.at[up] / half[up]);
    return room.light *
           painted(room.walls[static_cast<std::size_t>(exit.wall)], (0.5 * uv.array() + 0.5).cast<float>());
  }
  return Vector3f::Zero();
}

Vector3f encoded(const Vector3f& linear) {
  return linear.unaryExpr([](float c) { return std::clamp(srgb_encode(c), 0.0f, 1.0f); });
}

}  // namespace

Room random_room(Random& random, const TextureFolder* textures) {
  Room out;
  out.turn = random_rotation(random);
  for (double& half : out.half) half = kNearest * std::pow(kFarthest / kNearest, random.uniform());
  for (Paint& wall : out.walls) wall = random_paint(random, textures);
  out.light = static_cast<float>(random.uniform(0.2, 1));
  const double part = random.uniform(0, 2);
  if (part < 1) out.shown[random.below(2)] = 0.5 + 0.5 * part;
  return out;
}

Vector3f wall_colour(const Room& room, const Vector3d& origin, const Vector3d& direction) {
  return encoded(linear_wall_colour(room, origin, direction));
}

StoredView in_room(const StoredView& view, const Camera& camera, const Room& room) {
  StoredView out = view;
  if (view.opaque || !view.masked) return out;
  const Eigen::Matrix3d turn = camera.c2w().topLeftCorner<3, 3>();
  const Vector3d origin = camera.centre();
  const Eigen::Array2d size(camera.width, camera.height), shown = room.shown.array();
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      std::uint8_t* pixel = &out.rgba[4 * (static_cast<std::size_t>(y) * camera.width + x)];
      const Eigen::Array2d from_middle = (Eigen::Array2d(x + 0.5, y + 0.5) - 0.5 * size).abs();
      if ((from_middle > 0.5 * shown * size).any()) {
        std::fill_n(pixel, 4, std::uint8_t{0});
        continue;
      }
      if (pixel[3] < 255) {
        Vector3f sum = Vector3f::Zero();
        for (int i = 0; i < kSamples * kSamples; ++i) {
          const double px = x + (i % kSamples + 0.5) / kSamples, py = y + (i / kSamples + 0.5) / kSamples;
          const Vector3d ray((px - camera.cx) / camera.fx, (py - camera.cy) / camera.fy, 1);
          sum += linear_wall_colour(room, origin, turn * ray);
        }
        const Vector3f behind = encoded(sum / (kSamples * kSamples));
        const float alpha = static_cast<float>(pixel[3]) / 255;
        for (int c = 0; c < 3; ++c)
          pixel[c] = static_cast<std::uint8_t>(
              std::lround(alpha * static_cast<float>(pixel[c]) + (1 - alpha) * 255 * behind[c]));
      }
      pixel[3] = 255;
    }
  return out;
}

}  // namespace vsplat

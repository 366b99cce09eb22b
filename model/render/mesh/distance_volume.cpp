#include "model/render/mesh/distance_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "runtime/share_out.h"

namespace vsplat {

using Eigen::Vector3d, Eigen::Vector3f, Eigen::Vector3i;

// The weight of a ray that passes freely. It counts less than one that ends nearby: a few rays through gaps between
// Gaussians do not make holes, and many still clear what floats.
constexpr float kFree = 0.2f;
constexpr float kFarColour = 1e-3f;

// A picture's numbers in the precision of the points.
struct DistanceVolume::View {
  const DepthPicture& picture;
  Vector3f first;                       // the grid's first point, in camera coordinates
  std::array<Vector3f, 3> step;         // from a point to the next, along each axis
  float fx, fy, cx, cy, width, height;  // pixels
  // World units; weights decline behind the surface by more than `full`, and those of colours on both sides to 0.
  float truncation, full, colours;

  View(const DepthPicture& from, const Vector3d& low, double voxel, double truncated)
      : picture(from),
        first((from.camera.w2c.topLeftCorner<3, 3>() * low + from.camera.w2c.topRightCorner<3, 1>()).cast<float>()),
        step(),
        fx(static_cast<float>(from.camera.fx)),
        fy(static_cast<float>(from.camera.fy)),
        cx(static_cast<float>(from.camera.cx)),
        cy(static_cast<float>(from.camera.cy)),
        width(static_cast<float>(from.camera.width)),
        height(static_cast<float>(from.camera.height)),
        truncation(static_cast<float>(truncated)),
        full(static_cast<float>(voxel)),
        colours(static_cast<float>(std::min(4 * voxel, truncated))) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      step[axis] = (voxel * from.camera.w2c.col(static_cast<Eigen::Index>(axis)).head<3>()).cast<float>();
  }
};

DistanceVolume::DistanceVolume(const Vector3d& low, const Vector3d& high, double voxel, double truncation)
    : low_(low),
      voxel_(voxel),
      truncation_(truncation),
      size_((((high - low) / voxel).array() - 1e-6).ceil().cast<int>() + 1),
      blocks_((size_.array() - 1) / kEdge + 1),
      marked_(static_cast<std::size_t>(blocks_.x()) * static_cast<std::size_t>(blocks_.y()) *
              static_cast<std::size_t>(blocks_.z())) {}

void DistanceVolume::mark(const Camera& camera, const std::vector<float>& depth) {
  const Eigen::Matrix4d c2w = camera.c2w();
  const double edge = voxel_ * kEdge;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const double z =
          depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x)];
      if (!(z > 0)) continue;
      const Vector3d seen((x + 0.5 - camera.cx) / camera.fx * z, (y + 0.5 - camera.cy) / camera.fy * z, z);
      const Vector3d at = c2w.topLeftCorner<3, 3>() * seen + c2w.topRightCorner<3, 1>() - low_;
      // As far as the next pixel's surface, if that is farther.
      const double around = std::clamp(z / std::min(camera.fx, camera.fy), truncation_, 4 * truncation_);
      const Vector3i from = ((at.array() - around) / edge).floor().max(0.0).cast<int>(),
                     to = ((at.array() + around) / edge).floor().min(blocks_.array().cast<double>() - 1).cast<int>();
      for (int i = from.x(); i <= to.x(); ++i)
        for (int j = from.y(); j <= to.y(); ++j)
          for (int k = from.z(); k <= to.z(); ++k)
            marked_[(static_cast<std::size_t>(i) * static_cast<std::size_t>(blocks_.y()) +
                     static_cast<std::size_t>(j)) *
                        static_cast<std::size_t>(blocks_.z()) +
                    static_cast<std::size_t>(k)] = true;
    }
}

void DistanceVolume::allocate() {
  const auto count = static_cast<std::size_t>(std::count(marked_.begin(), marked_.end(), true));
  constexpr std::size_t bytes = kPoints * (sizeof(Point) + sizeof(std::uint32_t));  // with the vertices of surface()
  reserved_ = HostMemory(fmt::format("a volume of {} blocks of {} x {} x {} voxels", count, kEdge, kEdge, kEdge),
                         static_cast<double>(count) * bytes);
  index_.assign(marked_.size(), kNone);
  places_.reserve(count);
  std::size_t at = 0;
  for (int i = 0; i < blocks_.x(); ++i)
    for (int j = 0; j < blocks_.y(); ++j)
      for (int k = 0; k < blocks_.z(); ++k, ++at) {
        if (!marked_[at]) continue;
        index_[at] = static_cast<std::uint32_t>(places_.size());
        places_.emplace_back(i, j, k);
      }
  points_.resize(count * kPoints);
}

Vector3i DistanceVolume::first_point(std::size_t block) const { return kEdge * places_[block]; }

void DistanceVolume::fuse(const DepthPicture& picture) {
  constexpr std::size_t together = 256;  // blocks
  if (places_.empty()) return;
  const View view(picture, low_, voxel_, truncation_);
  ShareOut shared;
  shared.items = (places_.size() + together - 1) / together;
  shared.workers = std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, 64);
  shared.ahead = shared.items;
  shared.work = [&](std::size_t, std::size_t item) {
    const std::size_t end = std::min((item + 1) * together, places_.size());
    for (std::size_t block = item * together; block < end; ++block) fuse_block(block, view);
  };
  share_out(shared);
}

void DistanceVolume::fuse_block(std::size_t block, const View& v) {
  const Vector3f place = first_point(block).cast<float>();
  const Vector3f first = v.first + place.x() * v.step[0] + place.y() * v.step[1] + place.z() * v.step[2];
  Point* point = &points_[block * kPoints];
  for (int i = 0; i < kEdge; ++i)
    for (int j = 0; j < kEdge; ++j)
      for (int k = 0; k < kEdge; ++k, ++point) {
        const Vector3f at = first + static_cast<float>(i) * v.step[0] + static_cast<float>(j) * v.step[1] +
                            static_cast<float>(k) * v.step[2];
        if (!(at.z() > 0)) continue;
        const float x = v.fx * at.x() / at.z() + v.cx, y = v.fy * at.y() / at.z() + v.cy;
        if (!(x >= 0 && y >= 0 && x < v.width && y < v.height)) continue;
        const std::size_t pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(v.width) + static_cast<std::size_t>(x);
        const float depth = v.picture.depth[pixel];
        const float before = depth > 0 ? depth - at.z() : v.truncation;  // in front of the surface
        if (before <= -v.truncation) continue;
        float weight = before >= v.truncation ? kFree : 1;
        if (before < -v.full) weight = (before + v.truncation) / (v.truncation - v.full);
        if (depth > 0 && !v.picture.weight.empty()) weight *= v.picture.weight[pixel];
        point->weight += weight;
        point->distance += weight / point->weight * (std::min(before, v.truncation) - point->distance);
        // Colours come from the nearest surfaces alone, unless there are only others.
        const float away = std::abs(before);
        const float near = weight * (std::max(1 - away / v.colours, 0.0f) + kFarColour * (1 - away / v.truncation));
        if (!(near > 0)) continue;
        point->colour_weight += near;
        for (std::size_t c = 0; c < 3; ++c)
          point->colour[c] += near / point->colour_weight * (v.picture.colour[3 * pixel + c] - point->colour[c]);
      }
}

}  // namespace vsplat

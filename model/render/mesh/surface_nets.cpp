// DistanceVolume::surface().
#include <algorithm>
#include <cmath>

#include "model/render/mesh/distance_volume.h"

namespace vsplat {

using Eigen::Vector3d, Eigen::Vector3i;

namespace {

// Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2 & 1).
Vector3i corner(int c) { return {c & 1, c >> 1 & 1, c >> 2 & 1}; }

}  // namespace

std::size_t DistanceVolume::slot_of(int i, int j, int k) const {
  if (i < 0 || j < 0 || k < 0 || i >= size_.x() || j >= size_.y() || k >= size_.z()) return SIZE_MAX;
  const auto block = (static_cast<std::size_t>(i / kEdge) * static_cast<std::size_t>(blocks_.y()) +
                      static_cast<std::size_t>(j / kEdge)) *
                         static_cast<std::size_t>(blocks_.z()) +
                     static_cast<std::size_t>(k / kEdge);
  if (index_[block] == kNone) return SIZE_MAX;
  const int inside = (i % kEdge * kEdge + j % kEdge) * kEdge + k % kEdge;
  return static_cast<std::size_t>(index_[block]) * kPoints + static_cast<std::size_t>(inside);
}

// Whether the surface crosses a cell all of whose corners were seen.
bool DistanceVolume::corners_of(const Vector3i& cell, std::array<std::size_t, 8>& slots) const {
  int inside = 0;
  for (int c = 0; c < 8; ++c) {
    const Vector3i at = cell + corner(c);
    const std::size_t slot = slot_of(at.x(), at.y(), at.z());
    if (slot == SIZE_MAX || !(points_[slot].weight > 0)) return false;
    inside += points_[slot].distance < 0 ? 1 : 0;
    slots[static_cast<std::size_t>(c)] = slot;
  }
  return inside > 0 && inside < 8;
}

// At the mean of the places where the cell's edges are crossed.
void DistanceVolume::add_vertex(const Vector3i& cell, const std::array<std::size_t, 8>& slots,
                                SurfaceMesh& mesh) const {
  Vector3d sum = Vector3d::Zero();
  int crossed = 0;
  for (int c = 0; c < 8; ++c)
    for (int axis = 0; axis < 3; ++axis) {
      if (c >> axis & 1) continue;
      const double a = points_[slots[static_cast<std::size_t>(c)]].distance,
                   b = points_[slots[static_cast<std::size_t>(c | 1 << axis)]].distance;
      if ((a < 0) == (b < 0)) continue;
      sum += corner(c).cast<double>() + a / (a - b) * Vector3d::Unit(axis);
      ++crossed;
    }
  const Vector3d at = low_ + voxel_ * (cell.cast<double>() + sum / crossed);
  std::array<double, 3> colour{};
  double weight = 0;
  for (const std::size_t slot : slots) {
    const Point& p = points_[slot];
    for (std::size_t c = 0; c < 3; ++c) colour[c] += static_cast<double>(p.colour_weight) * p.colour[c];
    weight += p.colour_weight;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    mesh.positions.push_back(static_cast<float>(at[static_cast<Eigen::Index>(c)]));
    mesh.colours.push_back(weight > 0 ? static_cast<float>(std::clamp(colour[c] / weight, 0.0, 1.0)) : 0.5f);
  }
}

// Around the three edges of the grid that begin at the cell's first corner.
void DistanceVolume::add_quads(const Vector3i& cell, const std::vector<std::uint32_t>& vertex_of,
                               SurfaceMesh& mesh) const {
  const bool inside = points_[slot_of(cell.x(), cell.y(), cell.z())].distance < 0;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3i next = cell + Vector3i::Unit(axis), u = Vector3i::Unit((axis + 1) % 3),
                   v = Vector3i::Unit((axis + 2) % 3);
    if ((points_[slot_of(next.x(), next.y(), next.z())].distance < 0) == inside) continue;
    std::array<std::uint32_t, 4> quad{};
    const std::array<Vector3i, 4> around{cell - u - v, cell - v, cell, cell - u};
    bool complete = true;
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t slot = slot_of(around[i].x(), around[i].y(), around[i].z());
      quad[i] = slot == SIZE_MAX ? kNone : vertex_of[slot];
      complete = complete && quad[i] != kNone;
    }
    if (!complete) continue;
    if (!inside) std::swap(quad[1], quad[3]);
    const auto place = [&](std::size_t i) { return Eigen::Map<const Eigen::Vector3f>(&mesh.positions[3 * quad[i]]); };
    const std::size_t first = (place(0) - place(2)).squaredNorm() <= (place(1) - place(3)).squaredNorm() ? 0 : 1;
    for (const std::size_t i : {0, 1, 2, 0, 2, 3}) mesh.triangles.push_back(quad[(first + i) % 4]);
  }
}

SurfaceMesh DistanceVolume::surface() const {
  SurfaceMesh out;
  std::vector<std::uint32_t> vertex_of(points_.size(), kNone);
  const auto for_each_cell = [&](const auto& work) {
    for (std::size_t block = 0, slot = 0; block < places_.size(); ++block)
      for (int c = 0; c < kPoints; ++c, ++slot)
        work(slot, first_point(block) + Vector3i(c / (kEdge * kEdge), c / kEdge % kEdge, c % kEdge));
  };
  for_each_cell([&](std::size_t slot, const Vector3i& cell) {
    std::array<std::size_t, 8> slots{};
    if (!(points_[slot].weight > 0) || !corners_of(cell, slots)) return;
    vertex_of[slot] = static_cast<std::uint32_t>(out.vertex_count());
    add_vertex(cell, slots, out);
  });
  for_each_cell([&](std::size_t slot, const Vector3i& cell) {
    if (vertex_of[slot] != kNone) add_quads(cell, vertex_of, out);
  });
  return out;
}

}  // namespace vsplat

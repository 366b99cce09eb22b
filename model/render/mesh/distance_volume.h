// A truncated signed distance field, fused from depth pictures (Curless and Levoy 1996), and the surface where it is 0.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/base/camera.h"
#include "model/base/surface_mesh.h"
#include "runtime/system/host_memory.h"

namespace vsplat {

struct DepthPicture {
  Camera camera;
  std::vector<float> depth;   // [H][W] camera z of the surface; 0: the ray meets none
  std::vector<float> colour;  // [H][W][3], sRGB-encoded
  std::vector<float> weight;  // [H][W] of a pixel's depth, 0 to 1; empty: 1
};

// Points of a grid, in blocks of 8 x 8 x 8 that exist only near surfaces. First mark() them all, then allocate(), then
// fuse(): the result does not depend on which blocks an earlier picture reached.
class DistanceVolume {
 public:
  // The box is extended to whole blocks. Distances beyond `truncation` count as that.
  DistanceVolume(const Eigen::Vector3d& low, const Eigen::Vector3d& high, double voxel, double truncation);

  // Marks the blocks within the truncation of a picture's surface.
  void mark(const Camera& camera, const std::vector<float>& depth);
  // Error(memory) if the marked blocks do not fit.
  void allocate();
  // Adds a picture. A ray that meets nothing clears what it passes.
  void fuse(const DepthPicture& picture);

  // Surface nets: a vertex in each cell that the surface crosses, a quadrilateral around each crossed edge of the grid.
  // Only where all corners were seen. No edge is open but at the end of what was seen. Without normals.
  SurfaceMesh surface() const;

 private:
  static constexpr int kEdge = 8, kPoints = kEdge * kEdge * kEdge;
  static constexpr std::uint32_t kNone = UINT32_MAX;
  struct Point {
    float distance = 0, weight = 0;  // mean, positive outside; number of observations
    std::array<float, 3> colour{};   // mean
    float colour_weight = 0;
  };
  struct View;

  void fuse_block(std::size_t block, const View& view);
  std::size_t slot_of(int i, int j, int k) const;  // of a point among all points; SIZE_MAX if it does not exist
  bool corners_of(const Eigen::Vector3i& cell, std::array<std::size_t, 8>& slots) const;
  void add_vertex(const Eigen::Vector3i& cell, const std::array<std::size_t, 8>& slots, SurfaceMesh& mesh) const;
  void add_quads(const Eigen::Vector3i& cell, const std::vector<std::uint32_t>& vertex_of, SurfaceMesh& mesh) const;
  Eigen::Vector3i first_point(std::size_t block) const;

  Eigen::Vector3d low_;
  double voxel_, truncation_;
  Eigen::Vector3i size_;              // points along each axis
  Eigen::Vector3i blocks_;            // blocks along each axis; points of the last ones may lie beyond the volume
  std::vector<bool> marked_;          // [blocks]
  std::vector<std::uint32_t> index_;  // [blocks] among those that exist, or kNone
  std::vector<Eigen::Vector3i> places_;
  HostMemory reserved_;
  std::vector<Point> points_;  // [existing blocks][8][8][8]
};

}  // namespace vsplat

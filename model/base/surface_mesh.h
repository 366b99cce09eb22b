// A surface as triangles with a colour at each vertex.
#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace vsplat {

struct SurfaceMesh {
  std::vector<float> positions;                      // [V][3], relative to `offset`
  std::vector<float> normals;                        // [V][3], of length 1, outwards; empty until they are computed
  std::vector<float> colours;                        // [V][3], sRGB-encoded in [0,1]
  std::vector<std::uint32_t> triangles;              // [T][3], counter-clockwise seen from outside
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // as Scene::offset

  std::size_t vertex_count() const { return positions.size() / 3; }
  std::size_t triangle_count() const { return triangles.size() / 3; }
};

}  // namespace vsplat

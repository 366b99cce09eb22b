#include "model/render/mesh/mesh_reduction.h"

#include <meshoptimizer.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <vector>

namespace vsplat {
namespace {

using Eigen::Vector3f;

Vector3f position(const SurfaceMesh& mesh, std::uint32_t vertex) {
  return Eigen::Map<const Vector3f>(&mesh.positions[3 * static_cast<std::size_t>(vertex)]);
}

// Perpendicular to the triangle at `corner`, with twice its area as its length.
Vector3f area_normal(const SurfaceMesh& mesh, std::size_t corner) {
  const Vector3f first = position(mesh, mesh.triangles[corner]);
  return (position(mesh, mesh.triangles[corner + 1]) - first).cross(position(mesh, mesh.triangles[corner + 2]) - first);
}

// Removes vertices without triangles.
void compact(SurfaceMesh& mesh) {
  std::vector<std::uint32_t> now(mesh.vertex_count(), UINT32_MAX);
  std::uint32_t count = 0;
  for (const std::uint32_t vertex : mesh.triangles) now[vertex] = 0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (now[i] == UINT32_MAX) continue;
    now[i] = count;
    std::copy_n(&mesh.positions[3 * i], 3, &mesh.positions[3 * static_cast<std::size_t>(count)]);
    std::copy_n(&mesh.colours[3 * i], 3, &mesh.colours[3 * static_cast<std::size_t>(count)]);
    ++count;
  }
  mesh.positions.resize(3 * static_cast<std::size_t>(count));
  mesh.colours.resize(3 * static_cast<std::size_t>(count));
  for (std::uint32_t& vertex : mesh.triangles) vertex = now[vertex];
}

std::uint32_t root_of(std::vector<std::uint32_t>& parents, std::uint32_t vertex) {
  while (parents[vertex] != vertex) vertex = parents[vertex] = parents[parents[vertex]];
  return vertex;
}

}  // namespace

void drop_small_parts(SurfaceMesh& mesh, double share) {
  std::vector<std::uint32_t> parents(mesh.vertex_count());
  std::iota(parents.begin(), parents.end(), 0u);
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3)
    for (const std::size_t i : {1, 2})
      parents[root_of(parents, mesh.triangles[t + i])] = root_of(parents, mesh.triangles[t]);
  std::vector<double> areas(mesh.vertex_count(), 0.0);
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3)
    areas[root_of(parents, mesh.triangles[t])] += area_normal(mesh, t).norm();
  const double least = areas.empty() ? 0 : share * *std::max_element(areas.begin(), areas.end());
  std::vector<std::uint32_t> kept;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3)
    if (areas[root_of(parents, mesh.triangles[t])] >= least)
      kept.insert(kept.end(), &mesh.triangles[t], &mesh.triangles[t] + 3);
  mesh.triangles.swap(kept);
  compact(mesh);
}

void reduce_triangles(SurfaceMesh& mesh, std::size_t most) {
  if (mesh.triangle_count() <= most) return;
  constexpr float any_error = 1;  // of the mesh's extent
  constexpr std::size_t stride = 3 * sizeof(float);
  std::vector<std::uint32_t> out(mesh.triangles.size());
  out.resize(meshopt_simplify(out.data(), mesh.triangles.data(), mesh.triangles.size(), mesh.positions.data(),
                              mesh.vertex_count(), stride, 3 * most, any_error, 0, nullptr));
  if (out.size() > 3 * most) {  // it keeps every part and every hole: the other does not
    out.resize(mesh.triangles.size());
    out.resize(meshopt_simplifySloppy(out.data(), mesh.triangles.data(), mesh.triangles.size(), mesh.positions.data(),
                                      mesh.vertex_count(), stride, 3 * most, any_error, nullptr));
  }
  mesh.triangles.swap(out);
  compact(mesh);
}

void compute_normals(SurfaceMesh& mesh) {
  mesh.normals.assign(mesh.positions.size(), 0.0f);
  const auto normal = [&](std::uint32_t vertex) {
    return Eigen::Map<Vector3f>(&mesh.normals[3 * static_cast<std::size_t>(vertex)]);
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3)
    for (const std::size_t i : {0, 1, 2}) normal(mesh.triangles[t + i]) += area_normal(mesh, t);
  for (std::uint32_t i = 0; i < mesh.vertex_count(); ++i) {
    const float length = normal(i).norm();
    if (length > 0)
      normal(i) /= length;
    else
      normal(i) = Vector3f::UnitZ();
  }
}

}  // namespace vsplat

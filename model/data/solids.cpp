#include "model/data/solids.h"

#include <fmt/format.h>

#include "model/data/bodies.h"
#include "model/data/paints.h"

namespace vsplat {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int around = 64, along = 40;

Corner corner_at(const Surface& surface, const Matrix3d& linear, const Vector3d& offset, int i, int j) {
  Corner out;
  // Both sides of the seam are bitwise the same point, so that normals are averaged across it.
  const Vector3d p = surface(static_cast<double>(i % around) / around, static_cast<double>(j) / along);
  out.position = (linear * p + offset).cast<float>();
  out.uv = {static_cast<float>(i) / around, static_cast<float>(j) / along};
  return out;
}

void append_part(Mesh& mesh, Random& random, bool first) {
  const Surface surface = random_body(random).surface;
  Vector3d size, offset;
  for (double& s : size) s = random.uniform(0.25, first ? 1.0 : 0.7);
  for (double& o : offset) o = first ? 0.0 : random.uniform(-0.6, 0.6);
  const Matrix3d linear = random_rotation(random) * size.asDiagonal();
  const auto material = static_cast<std::uint32_t>(mesh.palette.size());
  mesh.palette.push_back({Vector3f::Ones(), random_texture(random)});
  for (int j = 0; j < along; ++j)
    for (int i = 0; i < around; ++i) {
      const Corner a = corner_at(surface, linear, offset, i, j), b = corner_at(surface, linear, offset, i + 1, j),
                   c = corner_at(surface, linear, offset, i + 1, j + 1),
                   d = corner_at(surface, linear, offset, i, j + 1);
      mesh.corners.insert(mesh.corners.end(), {a, c, b, a, d, c});
      mesh.materials.insert(mesh.materials.end(), 2, material);
    }
}

}  // namespace

Mesh random_solid(std::uint64_t seed, std::uint32_t index) {
  Random random(seed, index, solid_stream);
  Mesh out;
  out.name = fmt::format("solid {} of seed {}", index, seed);
  const int parts = 1 + random.below(4);
  for (int i = 0; i < parts; ++i) append_part(out, random, i == 0);
  compute_normals(out);
  return out;
}

}  // namespace vsplat

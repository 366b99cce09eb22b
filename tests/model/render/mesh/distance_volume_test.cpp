#include "model/render/mesh/distance_volume.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "model/render/mesh/mesh_reduction.h"
#include "model/views/orbit.h"
#include "runtime/error.h"
#include "runtime/system/host_memory.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr double kRadius = 0.4, kEdge = 1;
constexpr int kVoxels = 48, kSide = 96;

// A ball about `centre`, coloured by its place.
DepthPicture ball_from(const Vector3d& eye, const Vector3d& centre) {
  DepthPicture out;
  Camera& c = out.camera;
  c.width = c.height = kSide;
  c.fx = c.fy = 1.6 * kSide;
  c.cx = c.cy = 0.5 * kSide;
  c.w2c = look_at(eye, Vector3d::Zero(), Vector3d(0.1, 1, 0.2));
  const Eigen::Matrix3d turn = c.w2c.topLeftCorner<3, 3>().transpose();
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const Vector3d ray = turn * Vector3d((x + 0.5 - c.cx) / c.fx, (y + 0.5 - c.cy) / c.fy, 1), from = eye - centre;
      const double a = ray.squaredNorm(), b = ray.dot(from),
                   rest = b * b - a * (from.squaredNorm() - kRadius * kRadius);
      const double depth = rest > 0 ? (-b - std::sqrt(rest)) / a : 0;
      out.depth.push_back(static_cast<float>(depth));
      const Vector3d colour = eye + depth * ray + Vector3d::Constant(0.5);
      for (int i = 0; i < 3; ++i) out.colour.push_back(static_cast<float>(std::clamp(colour[i], 0.0, 1.0)));
    }
  return out;
}

std::vector<DepthPicture> ball_all_around(const Vector3d& centre = Vector3d::Zero()) {
  std::vector<DepthPicture> out;
  constexpr int count = 20;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1.0) / count, turn = 2.4 * i, across = std::sqrt(1 - z * z);
    out.push_back(ball_from(2 * Vector3d(across * std::cos(turn), across * std::sin(turn), z), centre));
  }
  return out;
}

SurfaceMesh meshed(const std::vector<DepthPicture>& pictures) {
  constexpr double voxel = kEdge / kVoxels;
  DistanceVolume volume(Vector3d::Constant(-kEdge / 2), Vector3d::Constant(kEdge / 2), voxel, 4 * voxel);
  for (const DepthPicture& picture : pictures) volume.mark(picture.camera, picture.depth);
  volume.allocate();
  for (const DepthPicture& picture : pictures) volume.fuse(picture);
  return volume.surface();
}

Vector3d place(const SurfaceMesh& mesh, std::size_t vertex) {
  return Eigen::Map<const Eigen::Vector3f>(&mesh.positions[3 * vertex]).cast<double>();
}

// Directed edges without their opposite.
std::size_t open_edges(const SurfaceMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3)
    for (std::size_t i = 0; i < 3; ++i) ++edges[{mesh.triangles[t + i], mesh.triangles[t + (i + 1) % 3]}];
  return static_cast<std::size_t>(std::count_if(edges.begin(), edges.end(), [&](const auto& edge) {
    const auto opposite = edges.find({edge.first.second, edge.first.first});
    return opposite == edges.end() || opposite->second != edge.second;
  }));
}

double volume_of(const SurfaceMesh& mesh) {
  double out = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3)
    out += place(mesh, mesh.triangles[t])
               .dot(place(mesh, mesh.triangles[t + 1]).cross(place(mesh, mesh.triangles[t + 2])));
  return out / 6;
}

void expect_ball(const SurfaceMesh& mesh, double accuracy) {
  EXPECT_EQ(open_edges(mesh), 0u);
  EXPECT_NEAR(volume_of(mesh), 4.0 / 3 * M_PI * std::pow(kRadius, 3),
              0.02);  // positive: counter-clockwise from outside
  double off = 0, colour = 0;
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    const Vector3d at = place(mesh, i);
    off += std::abs(at.norm() - kRadius);
    for (std::size_t c = 0; c < 3; ++c)
      colour = std::max(colour, std::abs(mesh.colours[3 * i + c] - at[static_cast<Eigen::Index>(c)] - 0.5));
  }
  EXPECT_LT(off / static_cast<double>(mesh.vertex_count()), accuracy);
  EXPECT_LT(colour, 0.03);
}

TEST(DistanceVolume, HoldsTheSurfaceThatThePicturesShow) {
  const SurfaceMesh mesh = meshed(ball_all_around());
  EXPECT_GT(mesh.triangle_count(), 6000u);
  expect_ball(mesh, 0.1 * kEdge / kVoxels);
  EXPECT_EQ(meshed(ball_all_around()).positions, mesh.positions);  // to the bit, whatever the threads do
}

TEST(DistanceVolume, IsOpenWhereNothingWasSeen) {
  const SurfaceMesh mesh = meshed({ball_from({0, 0, 2}, Vector3d::Zero())});
  EXPECT_GT(open_edges(mesh), 20u);
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) EXPECT_GT(place(mesh, i).z(), -0.1);
  // The end of the box cuts, too.
  EXPECT_GT(open_edges(meshed(ball_all_around({0.3, 0, 0}))), 20u);
}

TEST(DistanceVolume, MayBeEmpty) {
  EXPECT_EQ(meshed({}).triangle_count(), 0u);
  EXPECT_EQ(meshed({ball_from({0, 0, 2}, {5, 5, 0})}).triangle_count(), 0u);
}

TEST(DistanceVolume, TellsWhatMemoryItNeeds) {
  const std::size_t limit = host_memory_limit();
  set_host_memory_limit(reserved_host_memory() + 100000);
  test::expect_error(Status::memory, {"blocks of 8 x 8 x 8 voxels"}, [] { meshed(ball_all_around()); });
  set_host_memory_limit(limit);
}

TEST(MeshReduction, KeepsTheLimitAndTheShape) {
  SurfaceMesh mesh = meshed(ball_all_around());
  reduce_triangles(mesh, 1000);
  EXPECT_LE(mesh.triangle_count(), 1000u);
  EXPECT_GT(mesh.triangle_count(), 900u);
  EXPECT_EQ(*std::max_element(mesh.triangles.begin(), mesh.triangles.end()), mesh.vertex_count() - 1);
  expect_ball(mesh, 0.2 * kEdge / kVoxels);
  compute_normals(mesh);
  double mean = 0;
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    const double along =
        place(mesh, i).normalized().dot(Eigen::Map<const Eigen::Vector3f>(&mesh.normals[3 * i]).cast<double>());
    EXPECT_GT(along, 0.25);  // meshoptimizer leaves a few triangles on edge
    mean += along / static_cast<double>(mesh.vertex_count());
  }
  EXPECT_GT(mean, 0.99);
  reduce_triangles(mesh, 1000000);  // fewer already
  EXPECT_GT(mesh.triangle_count(), 900u);
  reduce_triangles(mesh, 30);
  EXPECT_LE(mesh.triangle_count(), 30u);
}

TEST(MeshReduction, DropsSmallParts) {
  const SurfaceMesh ball = meshed(ball_all_around());
  SurfaceMesh both = ball;
  for (std::size_t i = 0; i < ball.positions.size(); ++i) {
    both.positions.push_back(0.2f * ball.positions[i] + 2);
    both.colours.push_back(ball.colours[i]);
  }
  for (const std::uint32_t vertex : ball.triangles)
    both.triangles.push_back(vertex + static_cast<std::uint32_t>(ball.vertex_count()));
  SurfaceMesh kept = both;
  drop_small_parts(kept, 0.03);  // it has 0.04 of the area
  EXPECT_EQ(kept.triangles, both.triangles);
  drop_small_parts(kept, 0.05);
  EXPECT_EQ(kept.triangles, ball.triangles);
  EXPECT_EQ(kept.positions, ball.positions);
  EXPECT_EQ(kept.colours, ball.colours);
}

}  // namespace
}  // namespace vsplat

// The surface of a scene as a triangle mesh: depths drawn from cameras about it, fused in a distance field.
#pragma once
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/base/scene.h"
#include "model/base/surface_mesh.h"

namespace vsplat {

class Context;

// Which depth of a pixel is its surface's.
enum class SurfaceDepth { median, expected };

inline constexpr int kFewestVoxels = 16, kMostVoxels = 2048;

struct SceneMeshOptions {
  std::vector<Camera> cameras;    // at least one, in the scene's frame; larger pictures than the voxels need are scaled
  bool about = false;             // the cameras stand all around the scene, and see nothing else
  int voxels = 256;               // along the longest edge of the box
  std::size_t max_triangles = 0;  // 0: no limit
  double least_part = 0.01;       // smaller connected parts are left out: share of the largest part's area
  SurfaceDepth depth = SurfaceDepth::median;
  // The cube in the scene's frame; nothing: the box of what the cameras see. Unless they stand about the scene, that
  // box ends at 1.1 times the largest distance of a camera from their mean, or at 1.3 times the median distance of the
  // surface, whichever is larger.
  struct Cube {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double edge = 1;
  };
  std::optional<Cube> cube;
  // Called before each piece of work with the stage and the share that is done; it may throw.
  std::function<void(const char* stage, double done)> begin;
};

// Error(input) if the pictures show no surface. Error(memory) if the volume does not fit.
SurfaceMesh mesh_of(Context& ctx, const Scene& scene, const SceneMeshOptions& options);

}  // namespace vsplat

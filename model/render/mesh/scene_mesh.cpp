#include "model/render/mesh/scene_mesh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <span>
#include <thread>

#include "model/base/statistics.h"
#include "model/render/geometry.h"
#include "model/render/mesh/distance_volume.h"
#include "model/render/mesh/mesh_reduction.h"
#include "model/render/render.h"
#include "runtime/context.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/share_out.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr float kOpaque = 0.5f;        // alpha from which on a pixel shows a surface
constexpr double kPixelsPerVoxel = 2;  // along the longer side of a picture
constexpr int kGap = 2;                // pixels to each side that close_gaps() looks at
constexpr int kLeastSide = 128, kMostSide = 2048;
constexpr double kSmallPixels = 1 << 25;  // of all small pictures, which are held together
constexpr std::size_t kBoxPoints = 1 << 21;

Camera scaled(const Camera& camera, double longest) {
  const double factor = std::min(1.0, longest / std::max(camera.width, camera.height));
  Camera out = camera;
  out.width = std::max(1, static_cast<int>(std::lround(camera.width * factor)));
  out.height = std::max(1, static_cast<int>(std::lround(camera.height * factor)));
  const double x = static_cast<double>(out.width) / camera.width, y = static_cast<double>(out.height) / camera.height;
  out.fx *= x, out.cx *= x, out.fy *= y, out.cy *= y;
  return out;
}

std::size_t pixel_at(const Camera& camera, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
}

// Calls `work` for each row of a picture, on all processors.
template <class Work>
void for_each_row(const Camera& camera, const Work& work) {
  ShareOut shared;
  shared.items = static_cast<std::size_t>(camera.height);
  shared.workers = std::clamp(std::thread::hardware_concurrency(), 1u, 64u);
  shared.ahead = shared.items;
  shared.work = [&](std::size_t, std::size_t row) { work(static_cast<int>(row)); };
  share_out(shared);
}

// Replaces each depth by the median of those around it: a gap between Gaussians, through which a few pixels see what is
// behind, is closed.
void close_gaps(DepthPicture& picture) {
  const Camera& c = picture.camera;
  const std::vector<float> drawn = picture.depth;
  for_each_row(c, [&](int y) {
    std::vector<float> around;
    for (int x = 0; x < c.width; ++x) {
      around.clear();
      for (int j = std::max(y - kGap, 0); j <= std::min(y + kGap, c.height - 1); ++j)
        for (int i = std::max(x - kGap, 0); i <= std::min(x + kGap, c.width - 1); ++i)
          around.push_back(drawn[pixel_at(c, i, j)]);
      const auto middle = around.begin() + static_cast<std::ptrdiff_t>(around.size() / 2);
      std::nth_element(around.begin(), middle, around.end());
      picture.depth[pixel_at(c, x, y)] = *middle;
    }
  });
}

// Weights depths by the squared cosine between the ray and the surface, from the depths beside them: little at edges.
void weigh_by_slope(DepthPicture& picture) {
  constexpr double least = 0.02;
  const Camera& c = picture.camera;
  picture.weight.assign(picture.depth.size(), static_cast<float>(least));
  const auto point = [&](int x, int y) {
    const double z = picture.depth[pixel_at(c, x, y)];
    return Vector3d((x + 0.5 - c.cx) / c.fx * z, (y + 0.5 - c.cy) / c.fy * z, z);
  };
  for_each_row(c, [&](int y) {
    if (y == 0 || y == c.height - 1) return;
    for (int x = 1; x < c.width - 1; ++x) {
      const Vector3d at = point(x, y), left = point(x - 1, y), right = point(x + 1, y), up = point(x, y - 1),
                     down = point(x, y + 1);
      if (!(at.z() > 0 && left.z() > 0 && right.z() > 0 && up.z() > 0 && down.z() > 0)) continue;
      const Vector3d normal = (right - left).cross(down - up);
      const double cosine = normal.dot(at) / std::max(normal.norm() * at.norm(), 1e-30);
      picture.weight[pixel_at(c, x, y)] = static_cast<float>(std::max(cosine * cosine, least));
    }
  });
}

// Draws depth pictures of one scene.
class DepthDrawing {
 public:
  DepthDrawing(Context& ctx, const Scene& scene, SurfaceDepth depth, double pixels)
      : ctx_(ctx), scene_(place_on_device(ctx, scene.gaussians, pixels)), depth_(depth) {
    how_.background = {0, 0, 0};
    how_.near = scene.near;
    how_.mirror = scene.mirror;
    how_.antialias = scene.antialias;
    how_.maps.median = scene_.kind == GaussianKind::surfel && depth == SurfaceDepth::median;
  }

  DepthPicture draw(const Camera& camera) const {
    Picture drawn = render_picture(ctx_, scene_, camera, how_);
    std::vector<float> median = std::move(drawn.median.data);
    if (depth_ == SurfaceDepth::median && !how_.maps.median) median = pick(ctx_, scene_, camera, how_).median;
    DepthPicture out{camera, std::move(drawn.depth.data), std::move(drawn.colour.data), {}};
    for (std::size_t i = 0; i < out.depth.size(); ++i) {
      const float alpha = drawn.alpha.data[i];
      if (!(alpha >= kOpaque)) {
        out.depth[i] = 0;
        continue;
      }
      out.depth[i] = depth_ == SurfaceDepth::median ? median[i] : out.depth[i] / alpha;
      for (std::size_t c = 0; c < 3; ++c) out.colour[3 * i + c] /= alpha;
    }
    close_gaps(out);
    weigh_by_slope(out);
    return out;
  }

 private:
  Context& ctx_;
  const GaussianChunks scene_;
  const SurfaceDepth depth_;
  RenderOptions how_;
};

struct Box {
  Vector3d low, high;
};

// Points of the pictures' surfaces in the scene's frame, from evenly many pixels of each.
std::vector<Vector3d> points_of(const std::vector<DepthPicture>& pictures) {
  std::size_t pixels = 0;
  for (const DepthPicture& picture : pictures) pixels += picture.depth.size();
  const std::size_t step = pixels / kBoxPoints + 1;
  std::vector<Vector3d> out;
  for (const DepthPicture& picture : pictures) {
    const Camera& c = picture.camera;
    const Eigen::Matrix4d c2w = c.c2w();
    const auto width = static_cast<std::size_t>(c.width);
    for (std::size_t i = 0; i < picture.depth.size(); i += step) {
      const std::size_t row = i / width;
      const double z = picture.depth[i], x = static_cast<double>(i % width) + 0.5, y = static_cast<double>(row) + 0.5;
      if (!(z > 0)) continue;
      const Vector3d seen((x - c.cx) / c.fx * z, (y - c.cy) / c.fy * z, z);
      out.emplace_back(c2w.topLeftCorner<3, 3>() * seen + c2w.topRightCorner<3, 1>());
    }
  }
  return out;
}

// Half the edge of the cube to which a place is limited, about the mean of its cameras.
double reach_of(std::span<const Camera> cameras, const std::vector<Vector3d>& points, const Vector3d& middle) {
  constexpr double beyond_cameras = 1.1, beyond_surface = 1.3;
  double farthest = 0;
  for (const Camera& camera : cameras) farthest = std::max(farthest, (camera.centre() - middle).norm());
  std::vector<double> distances;
  distances.reserve(points.size());
  for (const Vector3d& point : points) distances.push_back((point - middle).norm());
  return std::max(beyond_cameras * farthest, beyond_surface * median(distances));
}

// The box of the points without strays, with a margin.
Box box_of(const std::vector<Vector3d>& points) {
  constexpr double strays = 0.0005, margin = 0.05;
  Box out;
  std::vector<double> values(points.size());
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::transform(points.begin(), points.end(), values.begin(), [&](const Vector3d& p) { return p[axis]; });
    out.low[axis] = quantile(values, strays);
    out.high[axis] = quantile(values, 1 - strays);
  }
  const double wider = margin * (out.high - out.low).maxCoeff();
  out.low.array() -= wider;
  out.high.array() += wider;
  return out;
}

Box box_for(const SceneMeshOptions& options, const std::vector<DepthPicture>& pictures) {
  if (options.cube) {
    const Vector3d half = Vector3d::Constant(0.5 * options.cube->edge);
    return {options.cube->centre - half, options.cube->centre + half};
  }
  std::vector<Vector3d> points = points_of(pictures);
  if (points.empty())
    fail(Status::input, "the scene shows no surface in {} pictures: nothing in them is opaque", options.cameras.size());
  if (!options.about) {
    Vector3d middle = Vector3d::Zero();
    for (const Camera& camera : options.cameras)
      middle += camera.centre() / static_cast<double>(options.cameras.size());
    const double reach = reach_of(options.cameras, points, middle);
    std::erase_if(points, [&](const Vector3d& p) { return (p - middle).cwiseAbs().maxCoeff() > reach; });
  }
  return box_of(points);
}

}  // namespace

SurfaceMesh mesh_of(Context& ctx, const Scene& scene, const SceneMeshOptions& options) {
  const double side = std::clamp<double>(kPixelsPerVoxel * options.voxels, kLeastSide, kMostSide);
  const auto share = [&](std::size_t i) {
    return static_cast<double>(i) / static_cast<double>(options.cameras.size());
  };
  const DepthDrawing drawing(ctx, scene, options.depth, side * side);
  // Small pictures say where the surface is, so that the volume exists before anything is fused.
  const double small_side = std::min(0.5 * side, std::sqrt(kSmallPixels / static_cast<double>(options.cameras.size())));
  std::vector<DepthPicture> small;
  for (std::size_t i = 0; i < options.cameras.size(); ++i) {
    options.begin("surface", share(i));
    DepthPicture drawn = drawing.draw(scaled(options.cameras[i], small_side));
    small.push_back({drawn.camera, std::move(drawn.depth), {}, {}});
  }
  const Box box = box_for(options, small);
  const double edge = (box.high - box.low).maxCoeff();
  if (!(edge > 0)) fail(Status::input, "the scene's surface is a single point: there is nothing to mesh");
  // Depths of Gaussians scatter from view to view; where they disagree by more than the truncation, holes stay.
  const double voxel = edge / options.voxels, truncation = std::max(4 * voxel, edge / 32);
  DistanceVolume volume(box.low, box.high, voxel, truncation);
  for (const DepthPicture& picture : small) volume.mark(picture.camera, picture.depth);
  small.clear();
  volume.allocate();
  for (std::size_t i = 0; i < options.cameras.size(); ++i) {
    options.begin("fusion", share(i));
    volume.fuse(drawing.draw(scaled(options.cameras[i], side)));
  }
  options.begin("triangles", 0);
  SurfaceMesh out = volume.surface();
  options.begin("triangles", 0.5);
  drop_small_parts(out, options.least_part);
  verbose("{} triangles before they are reduced, voxels of {:.4g} world units", out.triangle_count(), voxel);
  if (options.max_triangles) reduce_triangles(out, options.max_triangles);
  if (out.triangles.empty())
    fail(Status::input, "no surface of the scene lies in the cube {}, {}, {} to {}, {}, {}", box.low.x(), box.low.y(),
         box.low.z(), box.high.x(), box.high.y(), box.high.z());
  compute_normals(out);
  out.offset = scene.offset;
  return out;
}

}  // namespace vsplat

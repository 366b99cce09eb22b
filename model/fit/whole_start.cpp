#include "model/fit/whole_start.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>

#include "model/base/merged_gaussians.h"
#include "model/base/rng.h"
#include "model/base/scene_edit.h"
#include "model/base/statistics.h"
#include "model/fit/fit_pictures.h"
#include "model/fit/fit_start.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr long kMostFar = 10000;
constexpr double kFarShare = 0.05, kFarLow = 10, kFarHigh = 100;  // distances in units
// Multiples of the usual depth. Gaussians close to a camera hide the scene: from 0.25 to 4 PSNR was 3 dB lower.
constexpr double kDepthLow = 0.7, kDepthHigh = 3;
constexpr float kRandomOpacity = 0.1f;  // most are in the wrong place, so they hide little; with 0.5 it was 7 dB worse
constexpr double kUsualDepth = 5;       // in units, if the axes do not meet
constexpr int kColourPixels = 256;      // longer side of the pictures that colours come from
constexpr std::size_t kColourCap = std::size_t{256} << 20;
constexpr int kCells = 24;  // along a picture's longer side
constexpr double kHigh = 0.1;

// Which cells of a picture show points.
class Occupied {
 public:
  Occupied(const Camera& camera, const std::vector<ColoredPoint>& points)
      : cell_(static_cast<double>(std::max(camera.width, camera.height)) / kCells), cells_(kCells * kCells, false) {
    for (const ColoredPoint& point : points)
      if (const auto at = seen_at(camera, point.position)) cells_[cell(at->x(), at->y())] = true;
  }
  bool at(double u, double v) const { return cells_[cell(u, v)]; }

 private:
  std::size_t cell(double u, double v) const {
    const auto along = [this](double x) { return std::clamp(static_cast<int>(x / cell_), 0, kCells - 1); };
    return static_cast<std::size_t>(along(v)) * kCells + static_cast<std::size_t>(along(u));
  }
  double cell_;
  std::vector<bool> cells_;
};

// Draws random rays through pixels of the views.
class RandomRays {
 public:
  RandomRays(const WholeStart& start, FitPictures& pictures, const std::vector<int>& views, const char* stream)
      : start_(start), pictures_(pictures), views_(views), stream_(stream_of(stream)) {}

  struct Ray {
    std::size_t view = 0;  // its place in the list of views
    double u = 0, v = 0;
    Vector3d from, direction;  // direction of length 1, in the world
    std::array<float, 3> colour{};
    double random = 0;  // in [0,1), independent of the others
  };
  Ray draw(std::uint32_t number) const {
    const auto random = philox4x32_10({number, 0, stream_, 0}, rng_key(start_.seed));
    Ray out;
    out.view = std::min(static_cast<std::size_t>(uniform01(random[0]) * static_cast<double>(views_.size())),
                        views_.size() - 1);
    const std::shared_ptr<const FitPicture> picture = pictures_.at(views_[out.view]);
    const Camera& c = picture->camera;
    out.u = uniform01(random[1]) * c.width;
    out.v = uniform01(random[2]) * c.height;
    out.random = uniform01(random[3]);
    out.from = c.centre();
    out.direction =
        (c.w2c.topLeftCorner<3, 3>().transpose() * Vector3d((out.u - c.cx) / c.fx, (out.v - c.cy) / c.fy, 1))
            .normalized();
    const std::size_t pixel =
        static_cast<std::size_t>(out.v) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(out.u);
    const std::uint8_t* rgba = &picture->rgba[4 * pixel];
    for (std::size_t i = 0; i < 3; ++i) out.colour[i] = static_cast<float>(rgba[i] + 255 - rgba[3]) / 255.0f;
    return out;
  }

 private:
  const WholeStart& start_;
  FitPictures& pictures_;
  const std::vector<int>& views_;
  std::uint32_t stream_;
};

double between(double low, double high, double share) { return low * std::pow(high / low, share); }

// Positions about the frame's centre, in units.
struct Seeds {
  std::vector<Vector3d> positions;
  std::vector<std::array<float, 3>> colours;

  void add(const WholeStart& start, const Vector3d& world, const std::array<float, 3>& colour) {
    positions.push_back((world - start.frame.placement.centre) / start.frame.placement.edge);
    colours.push_back(colour);
  }
};

void add_points(const WholeStart& start, std::size_t most, Seeds& out) {
  const std::size_t all = start.points.size(), n = std::min(all, most);
  for (std::size_t i = 0; i < n; ++i) {
    const ColoredPoint& point = start.points[i * all / n];
    out.add(start, point.position, {point.rgb[0] / 255.0f, point.rgb[1] / 255.0f, point.rgb[2] / 255.0f});
  }
}

double usual_depth(const WholeStart& start, std::span<const Camera> cameras) {
  const double unit = start.frame.placement.edge;
  const std::optional<Vector3d> meet = where_axes_meet(cameras);
  if (!meet) return kUsualDepth * unit;
  std::vector<double> depths;
  for (const Camera& camera : cameras) depths.push_back((camera.w2c * meet->homogeneous()).z());
  const double depth = median(depths);
  return depth > 0 ? std::min(depth, kFarLow * unit) : kUsualDepth * unit;
}

void add_random(const WholeStart& start, const RandomRays& rays, double depth, long count, Seeds& out) {
  for (long i = 0; i < count; ++i) {
    const RandomRays::Ray ray = rays.draw(static_cast<std::uint32_t>(i));
    out.add(start, ray.from + between(kDepthLow, kDepthHigh, ray.random) * depth * ray.direction, ray.colour);
  }
}

long add_far(const WholeStart& start, const RandomRays& rays, const std::vector<Occupied>& occupied, long count,
             Seeds& out) {
  long added = 0;
  for (long i = 0; i < 8 * count && added < count; ++i) {
    const RandomRays::Ray ray = rays.draw(static_cast<std::uint32_t>(i));
    if (occupied[ray.view].at(ray.u, ray.v)) continue;
    const double distance = between(kFarLow, kFarHigh, ray.random) * start.frame.placement.edge;
    out.add(start, ray.from + distance * ray.direction, ray.colour);
    ++added;
  }
  return added;
}

}  // namespace

Scene whole_scene(const WholeStart& start, const Photographs& photographs, const std::vector<int>& views) {
  FitPictures pictures(photographs, {}, kColourPixels, kColourCap);
  std::vector<Camera> cameras;
  std::vector<Occupied> occupied;
  for (auto view = views.begin(); view != views.end(); ++view) {
    cameras.push_back(pictures.at(*view)->camera);
    pictures.read_ahead({view + 1, views.end()});
    occupied.emplace_back(cameras.back(), start.points);
  }
  const long most = start.most > 0 ? start.most : std::numeric_limits<long>::max();
  Seeds seeds;
  if (start.points.empty()) {
    const RandomRays rays(start, pictures, views, "fit.whole");
    add_random(start, rays, usual_depth(start, cameras), std::min(start.random, most), seeds);
  } else {
    add_points(start, static_cast<std::size_t>(most), seeds);
  }
  const auto near_ones = static_cast<long>(seeds.positions.size());
  const long wanted = std::min(
      {static_cast<long>(kFarShare * static_cast<double>(near_ones)), kMostFar, std::max(most - near_ones, 0L)});
  const long far = add_far(start, {start, pictures, views, "fit.far"}, occupied, wanted, seeds);
  info("starts from {} {} and {} far away", near_ones, start.points.empty() ? "random points" : "points", far);
  StartPoints out{PointRows(static_cast<Eigen::Index>(seeds.positions.size()), 3), std::move(seeds.colours)};
  for (std::size_t i = 0; i < seeds.positions.size(); ++i)
    out.positions.row(static_cast<Eigen::Index>(i)) = seeds.positions[i].transpose();
  Scene made = isotropic_scene(out, start.frame.placement, start.frame.near, kHigh);
  if (start.points.empty()) made.gaussians.opacities.assign(made.gaussians.count, kRandomOpacity);
  return made;
}

Scene with_object(Scene scene, Scene object, const Placement& cube, std::size_t most) {
  const std::size_t all = scene.gaussians.count;
  keep(scene.gaussians, [&](std::size_t k) {
    const Vector3d at = Eigen::Map<const Eigen::Vector3f>(&scene.gaussians.means[3 * k]).cast<double>() + scene.offset;
    return ((at - cube.centre) / cube.edge).cwiseAbs().maxCoeff() > 0.5;
  });
  info("{} of the {} Gaussians at the start lie in the object's cube: there the object's take their place",
       all - scene.gaussians.count, all);
  drop_mirror(object);
  if (object.gaussians.kind == GaussianKind::volume)  // append() refuses others
    object.gaussians = merged_gaussians(object.gaussians, most);
  const float near = scene.near;
  append(scene, object, {});
  scene.near = near;
  return scene;
}

}  // namespace vsplat

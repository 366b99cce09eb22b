#include "model/fit/fit_start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "model/base/point_tree.h"
#include "model/base/rng.h"
#include "model/fit/fit_pictures.h"
#include "model/views/seen_points.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

constexpr std::size_t kNeighbours = 3;
constexpr double kLowScale = 1e-4, kHighScale = 0.1;  // of the edge
constexpr float kOpacity = 0.5f;
constexpr double kMargin = 0.1;  // of the extent of the places that were found
constexpr long kTries = 2000;    // for each Gaussian of a random start

// Mean distance of each position to its nearest neighbours, in the unit of `positions`.
std::vector<double> neighbour_distances(const PointRows& positions) {
  const PointsForTree points{positions};
  const PointTree tree(3, points);
  std::vector<double> out;
  out.reserve(static_cast<std::size_t>(positions.rows()));
  for (Eigen::Index i = 0; i < positions.rows(); ++i) {
    std::array<Eigen::Index, kNeighbours + 1> found{};  // includes the point itself, or a duplicate of it
    std::array<double, kNeighbours + 1> squared{};
    const std::size_t n = tree.knnSearch(positions.row(i).data(), found.size(), found.data(), squared.data());
    double sum = 0;
    for (std::size_t k = 1; k < n; ++k) sum += std::sqrt(squared[k]);
    out.push_back(n > 1 ? sum / static_cast<double>(n - 1) : kHighScale);
  }
  return out;
}

}  // namespace

Scene isotropic_scene(const StartPoints& points, const Placement& placement, double near, double high) {
  const auto n = static_cast<std::size_t>(points.positions.rows());
  Scene out;
  out.near = static_cast<float>(near);
  out.offset = offset_for(placement.centre, placement.edge);
  const Eigen::Vector3d centre = placement.centre - out.offset;
  Gaussians& g = out.gaussians;
  g.count = n;
  g.quats.assign(4 * n, 0.0f);
  g.opacities.assign(n, kOpacity);
  const std::vector<double> distances = neighbour_distances(points.positions);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d about = points.positions.row(static_cast<Eigen::Index>(i)).transpose();
    const Eigen::Vector3d at = centre + placement.edge * about;
    const double size = placement.edge * std::clamp(distances[i], kLowScale, high * std::max(1.0, about.norm()));
    g.quats[4 * i] = 1;
    for (std::size_t c = 0; c < 3; ++c) {
      g.means.push_back(static_cast<float>(at[static_cast<Eigen::Index>(c)]));
      g.scales.push_back(static_cast<float>(size));
      g.sh.push_back(static_cast<float>((points.colours[i][c] - 0.5) / kShC0));
    }
  }
  return out;
}

Scene scene_from_points(std::span<const ColoredPoint> points, const Placement& placement, long most) {
  std::vector<const ColoredPoint*> inside;
  for (const ColoredPoint& point : points)
    if (((point.position - placement.centre) / placement.edge).cwiseAbs().maxCoeff() <= 0.5) inside.push_back(&point);
  if (inside.empty())
    fail(Status::input,
         "none of the {} points lies in the object's cube, centre {}, edge {:.6g}: set it with {} and {}",
         points.size(), to_text(placement.centre), placement.edge, Option::center, Option::scale);
  const std::size_t n = most > 0 ? std::min(inside.size(), static_cast<std::size_t>(most)) : inside.size();
  info("{} of the {} points lie in the object's cube{}", inside.size(), points.size(),
       n < inside.size() ? fmt::format(", {} of them are used", n) : "");
  StartPoints start{PointRows(static_cast<Eigen::Index>(n), 3), {}};
  for (std::size_t i = 0; i < n; ++i) {
    const ColoredPoint& point = *inside[i * inside.size() / n];
    start.positions.row(static_cast<Eigen::Index>(i)) =
        (point.position - placement.centre).transpose() / placement.edge;
    start.colours.push_back({point.rgb[0] / 255.0f, point.rgb[1] / 255.0f, point.rgb[2] / 255.0f});
  }
  return isotropic_scene(start, placement, kNearInObject * placement.edge, kHighScale);
}

namespace {

// What small pictures show at a place.
class Shown {
 public:
  Shown(const Photographs& photographs, const std::vector<int>& views) {
    for (std::size_t i = 0; i < std::min(views.size(), kLookedAt); ++i)
      pictures_.push_back(FitPictures(photographs, {}, kLookedAtPixels, 0)
                              .at(views[i * views.size() / std::min(views.size(), kLookedAt)]));
  }

  // The mean colour; nothing if the place is not on the object, or not seen often enough.
  std::optional<std::array<float, 3>> at(const Eigen::Vector3d& place) const {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    std::size_t seen = 0;
    for (const auto& picture : pictures_) {
      const auto found = seen_at(picture->camera, place);
      if (!found) continue;
      const auto along = [](double x, int size) {
        return static_cast<std::size_t>(std::min(static_cast<int>(x), size - 1));
      };
      const auto [w, h] = std::pair(picture->camera.width, picture->camera.height);
      const std::uint8_t* rgba =
          &picture->rgba[4 * (along(found->y(), h) * static_cast<std::size_t>(w) + along(found->x(), w))];
      if (picture->masked && rgba[3] == 0) return std::nullopt;
      for (int c = 0; c < 3; ++c) sum[c] += static_cast<float>(rgba[c] + 255 - rgba[3]) / 255.0f;
      ++seen;
    }
    if (2 * seen < pictures_.size() || seen == 0) return std::nullopt;
    sum /= static_cast<float>(seen);
    return std::array{sum.x(), sum.y(), sum.z()};
  }

 private:
  static constexpr std::size_t kLookedAt = 16;
  static constexpr int kLookedAtPixels = 256;
  std::vector<std::shared_ptr<const FitPicture>> pictures_;
};

}  // namespace

Scene random_scene(const Placement& placement, long count, std::uint64_t seed, const Photographs& photographs,
                   const std::vector<int>& views) {
  const Shown shown(photographs, views);
  std::vector<Eigen::Vector3d> places;
  StartPoints start;
  Eigen::Array3d low = Eigen::Array3d::Constant(-0.5), high = -low;
  const auto place = [&](long number) {
    const auto random =
        philox4x32_10({static_cast<std::uint32_t>(number), 0, stream_of("fit.start"), 0}, rng_key(seed));
    const Eigen::Array3d at(uniform01(random[0]), uniform01(random[1]), uniform01(random[2]));
    return Eigen::Vector3d(low + at * (high - low));
  };
  const auto find = [&](long first) {
    for (long i = first; i < first + kTries * count && static_cast<long>(places.size()) < count; ++i) {
      const Eigen::Vector3d about = place(i);
      if (const auto colour = shown.at(placement.centre + placement.edge * about)) {
        places.push_back(about);
        start.colours.push_back(*colour);
      }
    }
  };
  find(0);
  if (!places.empty() && static_cast<long>(places.size()) < count) {  // the object is small in its cube
    Eigen::Array3d least = high, most = low;
    for (const Eigen::Vector3d& each : places) least = least.min(each.array()), most = most.max(each.array());
    low = low.max(least - kMargin * (most - least)), high = high.min(most + kMargin * (most - least));
    find(kTries * count);
  }
  if (places.empty())
    for (long i = 0; i < count; ++i) {
      places.push_back(place(i));
      start.colours.push_back({0.5f, 0.5f, 0.5f});
    }
  start.positions.resize(static_cast<Eigen::Index>(places.size()), 3);
  for (std::size_t i = 0; i < places.size(); ++i)
    start.positions.row(static_cast<Eigen::Index>(i)) = places[i].transpose();
  return isotropic_scene(start, placement, kNearInObject * placement.edge, kHighScale);
}

}  // namespace vsplat

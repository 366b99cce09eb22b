#include "model/fit/screen_size.h"

#include <algorithm>
#include <cmath>

#include "model/ops/render/project.h"

namespace vsplat {
namespace {

constexpr double kTilesOfGaussian = 32, kGaussiansOfTile = 2048;

// A Gaussian's position on the screen, and its extent, both in pixels.
struct Disc {
  double u = 0, v = 0, radius = 0;
};

// An upper bound of the tiles it touches: the rasteriser skips the square's corners.
double tiles_of(const Disc& disc, double largest, const Camera& camera) {
  const double r = std::min(disc.radius, largest);
  const auto along = [r](double at, long tiles) {
    const double first = std::floor((at - r) / kTile), last = std::floor((at + r) / kTile);
    return std::max(0.0, std::min(last, static_cast<double>(tiles - 1)) - std::max(first, 0.0) + 1);
  };
  return along(disc.u, tiles_along(camera.width)) * along(disc.v, tiles_along(camera.height));
}

std::vector<Disc> discs(const ScreenGaussians& g, const Camera& camera, float near,
                        const std::vector<float>& log_scales) {
  const Eigen::Matrix3d R = camera.w2c.topLeftCorner<3, 3>();
  const Eigen::Vector3d t = camera.w2c.topRightCorner<3, 1>();
  const double focal = std::max(camera.fx, camera.fy);
  std::vector<Disc> out(g.logits.size());
  for (std::size_t k = 0; k < out.size(); ++k) {
    const Eigen::Vector3d p = R * Eigen::Map<const Eigen::Vector3f>(&g.means[3 * k]).cast<double>() + t;
    const double opacity = 1 / (1 + std::exp(-static_cast<double>(g.logits[k])));
    if (!(p.z() > near) || !(opacity >= 1.0 / 255)) continue;
    // As in the rasteriser: the extent reaches three deviations, or to where alpha falls below 1/255, and is stretched
    // off the axis.
    const double sigmas = std::min(3.0, std::sqrt(2 * std::log(255 * opacity)));
    const double x = p.x() / p.z(), y = p.y() / p.z();
    const float* s = &log_scales[3 * k];
    const double sigma = std::exp(static_cast<double>(std::max({s[0], s[1], s[2]})));
    const double stretched = sigma * focal / p.z() * std::sqrt(1 + x * x + y * y);
    out[k] = {camera.fx * x + camera.cx, camera.fy * y + camera.cy, sigmas * std::hypot(stretched, 0.55) + 1};
  }
  return out;
}

}  // namespace

std::uint64_t affordable_tiles(const Camera& camera, long count) {
  const double tiles = static_cast<double>(tiles_along(camera.width)) * static_cast<double>(tiles_along(camera.height));
  return static_cast<std::uint64_t>(std::max(kTilesOfGaussian * static_cast<double>(count), kGaussiansOfTile * tiles));
}

void shrink_on_screen(const ScreenGaussians& gaussians, const Camera& camera, float near, std::uint64_t most,
                      float least, std::vector<float>& log_scales) {
  const std::vector<Disc> all = discs(gaussians, camera, near, log_scales);
  const double wanted = 0.8 * static_cast<double>(most);
  const auto touched = [&](double largest) {
    double sum = 0;
    for (const Disc& disc : all)
      if (disc.radius > 0) sum += tiles_of(disc, largest, camera);
    return sum;
  };
  double low = 0, high = 0;  // of the largest radius
  for (const Disc& disc : all) high = std::max(high, disc.radius);
  if (touched(high) <= wanted) return;
  for (int step = 0; step < 24; ++step) {
    const double middle = 0.5 * (low + high);
    (touched(middle) <= wanted ? low : high) = middle;
  }
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!(all[k].radius > low)) continue;
    float* s = &log_scales[3 * k];
    const double smaller = std::max({s[0], s[1], s[2]}) + std::log(std::max(low, 1.0) / all[k].radius);
    for (int i = 0; i < 3; ++i) s[i] = std::max(std::min(s[i], static_cast<float>(smaller)), std::min(s[i], least));
  }
}

}  // namespace vsplat

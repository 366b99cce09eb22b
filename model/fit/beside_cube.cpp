#include "model/fit/beside_cube.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "runtime/option.h"

namespace vsplat {
namespace {

constexpr float kAlike = 13.5f;  // of 255
constexpr double kMuch = 0.2;

}  // namespace

double shown_beside_cube(const FitPicture& picture, double edge, const std::array<float, 3>& background) {
  const Camera& c = picture.camera;
  if (picture.masked || c.width < 1 || c.height < 1) return 0;
  double x0 = c.width, y0 = c.height, x1 = 0, y1 = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const auto at = [corner, edge](int axis) { return (corner >> axis & 1) == 0 ? -0.5 * edge : 0.5 * edge; };
    const Eigen::Vector3d p = (c.w2c * Eigen::Vector4d(at(0), at(1), at(2), 1)).head<3>();
    if (!(p.z() > 0)) return 0;
    const double u = c.fx * p.x() / p.z() + c.cx, v = c.fy * p.y() / p.z() + c.cy;
    x0 = std::min(x0, u), y0 = std::min(y0, v), x1 = std::max(x1, u), y1 = std::max(y1, v);
  }
  long shown = 0;
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) {
      if (x + 0.5 > x0 && x + 0.5 < x1 && y + 0.5 > y0 && y + 0.5 < y1) continue;
      const std::size_t pixel = static_cast<std::size_t>(y) * c.width + x;
      const std::uint8_t* p = &picture.rgba[4 * pixel];
      bool other = false;
      for (std::size_t i = 0; i < 3; ++i) other |= std::abs(static_cast<float>(p[i]) - 255 * background[i]) > kAlike;
      shown += other && p[3] == 255 && (picture.known.empty() || picture.known[pixel] != 0);
    }
  return static_cast<double>(shown) / (static_cast<double>(c.width) * c.height);
}

std::string doubts_about_cube(const std::vector<double>& shares, std::size_t unmasked, std::size_t pictures) {
  if (shares.empty()) return "";
  const double mean = std::accumulate(shares.begin(), shares.end(), 0.0) / static_cast<double>(shares.size());
  if (mean <= kMuch) return "";
  return fmt::format(
      "{} of the {} pictures have neither mask nor alpha, and {:.0f} % of what they show lies beside the object's "
      "cube: the fit imitates it with fog in front of the cameras. Give masks (mask_path, or a folder masks/), or a "
      "larger cube ({})",
      unmasked, pictures, 100 * mean, Option::scale);
}

}  // namespace vsplat

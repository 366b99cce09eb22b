#include "model/base/scene_difference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include "model/base/point_tree.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

const char* name_of(GaussianKind kind) { return kind == GaussianKind::surfel ? "surfels" : "volumes"; }

void add(Differences& to, double value) {
  to.largest = std::max(to.largest, value);
  to.rms += value * value;  // the sum of squares until finish()
}

void finish(Differences& d, std::size_t values) {
  d.rms = values == 0 ? 0 : std::sqrt(d.rms / static_cast<double>(values));
}

// Compares Gaussians of two scenes.
class Pair {
 public:
  Pair(const Scene& a, const Scene& b) : a_(a.gaussians), b_(b.gaussians), shift_(b.offset - a.offset) {}

  Eigen::Vector3d mean_of_a(std::size_t i) const { return mean_of(a_, i); }
  Eigen::Vector3d mean_of_b(std::size_t j) const { return mean_of(b_, j) + shift_; }  // in the frame of a
  double apart(std::size_t i, std::size_t j) const { return (mean_of_a(i) - mean_of_b(j)).norm(); }

  std::size_t axes() const { return static_cast<std::size_t>(scales_of(a_.kind)); }
  std::size_t functions() const { return std::max(a_.sh_count(), b_.sh_count()); }
  double scale_apart(std::size_t i, std::size_t j, std::size_t axis) const {
    return std::abs(value(a_.scales[axes() * i + axis]) - value(b_.scales[axes() * j + axis]));
  }
  double opacity_apart(std::size_t i, std::size_t j) const {
    return std::abs(value(a_.opacities[i]) - value(b_.opacities[j]));
  }
  // `c`: the function times 3 plus the channel.
  double sh_apart(std::size_t i, std::size_t j, std::size_t c) const {
    return std::abs(sh_of(a_, i, c) - sh_of(b_, j, c));
  }
  double degrees_apart(std::size_t i, std::size_t j) const {
    using Quat = Eigen::Map<const Eigen::Vector4f>;
    const Eigen::Vector4d p = Quat(&a_.quats[4 * i]).cast<double>().normalized(),
                          q = Quat(&b_.quats[4 * j]).cast<double>().normalized();
    const double chord = std::min((p - q).norm(), (p + q).norm());
    return 4 * std::asin(std::min(0.5 * chord, 1.0)) * 180 / std::numbers::pi;
  }
  // For choosing among near Gaussians; `unit` makes lengths comparable with the other values.
  double unlike(std::size_t i, std::size_t j, double unit) const {
    double out = apart(i, j) / unit + opacity_apart(i, j) + degrees_apart(i, j) / 90;
    for (std::size_t axis = 0; axis < axes(); ++axis) out += scale_apart(i, j, axis) / unit;
    for (std::size_t c = 0; c < 3; ++c) out += sh_apart(i, j, c);
    return out;
  }

 private:
  static double value(float v) { return static_cast<double>(v); }
  static Eigen::Vector3d mean_of(const Gaussians& g, std::size_t k) {
    return {value(g.means[3 * k]), value(g.means[3 * k + 1]), value(g.means[3 * k + 2])};
  }
  static double sh_of(const Gaussians& g, std::size_t k, std::size_t c) {
    return c < 3 * g.sh_count() ? value(g.sh[3 * g.sh_count() * k + c]) : 0;
  }

  const Gaussians& a_;
  const Gaussians& b_;
  Eigen::Vector3d shift_;
};

// The Gaussian of b for each of a: the one most like it among the nearest.
std::vector<std::size_t> matched(const Pair& pair, std::size_t count, double unit) {
  PointRows rows(static_cast<Eigen::Index>(count), 3);
  for (std::size_t j = 0; j < count; ++j) rows.row(static_cast<Eigen::Index>(j)) = pair.mean_of_b(j);
  const PointsForTree points{rows};
  const PointTree tree(3, points);
  std::array<Eigen::Index, 16> nearest{};
  std::array<double, 16> squares{};
  std::vector<std::size_t> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d at = pair.mean_of_a(i);
    const std::size_t found = tree.knnSearch(at.data(), nearest.size(), nearest.data(), squares.data());
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < found; ++n) {
      const auto j = static_cast<std::size_t>(nearest[n]);
      const double unlike = pair.unlike(i, j, unit);
      if (unlike < least) least = unlike, out[i] = j;
    }
  }
  return out;
}

}  // namespace

SceneDifference difference(const Scene& a, const Scene& b) {
  const std::size_t count = a.gaussians.count;
  if (count != b.gaussians.count)
    fail(Status::input, "the scenes have {} and {} Gaussians: as many of both expected", count, b.gaussians.count);
  if (a.gaussians.kind != b.gaussians.kind)
    fail(Status::input, "one scene has {} and the other {}: the same kind expected", name_of(a.gaussians.kind),
         name_of(b.gaussians.kind));
  const Pair pair(a, b);
  SceneDifference out;
  if (count == 0) return out;
  // In another order, Gaussians of one number are about as far apart as any two.
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) middle += pair.mean_of_a(i) / static_cast<double>(count);
  double spread = 0, moved = 0;
  for (std::size_t i = 0; i < count; ++i) {
    spread += (pair.mean_of_a(i) - middle).norm() / static_cast<double>(count);
    moved += pair.apart(i, i) / static_cast<double>(count);
  }
  std::vector<std::size_t> other;
  out.in_order = count == 1 || moved <= 0.01 * spread;
  const double unit = spread > 0 ? spread / std::cbrt(static_cast<double>(count)) : 1;
  if (!out.in_order) other = matched(pair, count, unit);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t j = out.in_order ? i : other[i];
    add(out.means, pair.apart(i, j));
    for (std::size_t axis = 0; axis < pair.axes(); ++axis) add(out.scales, pair.scale_apart(i, j, axis));
    add(out.rotations, pair.degrees_apart(i, j));
    add(out.opacities, pair.opacity_apart(i, j));
    for (std::size_t c = 0; c < 3 * pair.functions(); ++c) add(out.sh, pair.sh_apart(i, j, c));
  }
  finish(out.means, count);
  finish(out.scales, count * pair.axes());
  finish(out.rotations, count);
  finish(out.opacities, count);
  finish(out.sh, 3 * count * pair.functions());
  return out;
}

}  // namespace vsplat

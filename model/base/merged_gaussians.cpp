#include "model/base/merged_gaussians.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "model/base/scene_edit.h"

namespace vsplat {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kHalvings = 40;            // of the logarithm of a cell's edge
constexpr double kSmallestCell = 1e-6;   // of the extent
constexpr double kSpare = 1.3;           // cells for each Gaussian that stays: many absorb little
constexpr double kBits = 20;             // of a cell's number along an axis
constexpr double kHighOpacity = 0.95;    // of merged Gaussians
constexpr double kMostOpacity = 0.9999;  // more would have no finite depth
constexpr double kFaintest = 1.0 / 255;  // the least opacity that is drawn

Vector3d centre_of(const Gaussians& g, std::size_t k) {
  return Eigen::Map<const Eigen::Vector3f>(&g.means[3 * k]).cast<double>();
}

// The product of the two larger standard deviations.
double area(const Vector3d& scales) { return scales.prod() / std::max(scales.minCoeff(), 1e-30); }

// Optical depth of an opacity: depths of Gaussians one after another add up. Less than kFaintest is not drawn, which is
// the rim of every Gaussian, and some whole ones: what a Gaussian absorbs in all is proportional to its area and to
// what exceeds that.
double seen_depth(double opacity) { return std::max(0.0, -std::log1p(-std::min(opacity, kMostOpacity)) - kFaintest); }
double opacity_of(double seen_depth) { return -std::expm1(-seen_depth - kFaintest); }

double absorbed(const Gaussians& g, std::size_t k) {
  return seen_depth(g.opacities[k]) * area(Eigen::Map<const Eigen::Vector3f>(&g.scales[3 * k]).cast<double>());
}

Matrix3d covariance(const Gaussians& g, std::size_t k) {
  const float* q = &g.quats[4 * k];
  const Matrix3d axes = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
  const Vector3d scales = Eigen::Map<const Eigen::Vector3f>(&g.scales[3 * k]).cast<double>();
  return axes * scales.cwiseAbs2().asDiagonal() * axes.transpose();
}

// Numbers the cells of a grid about `low`; places far outside share the outermost cells.
class Cells {
 public:
  explicit Cells(const Gaussians& g) : g_(g), low_(centre_of(g, 0)) {
    Vector3d high = low_;
    for (std::size_t k = 0; k < g.count; ++k)
      low_ = low_.cwiseMin(centre_of(g, k)), high = high.cwiseMax(centre_of(g, k));
    extent_ = (high - low_).maxCoeff();
  }
  double extent() const { return extent_; }
  std::vector<std::uint64_t> of(double edge) const {
    std::vector<std::uint64_t> out(g_.count, 0);
    const double last = std::exp2(kBits) - 1;
    for (std::size_t k = 0; k < g_.count; ++k)
      for (int i = 0; i < 3; ++i)
        out[k] = (out[k] << static_cast<int>(kBits)) |
                 static_cast<std::uint64_t>(std::min(std::floor((centre_of(g_, k)[i] - low_[i]) / edge), last));
    return out;
  }

 private:
  const Gaussians& g_;
  Vector3d low_;
  double extent_ = 0;
};

std::size_t distinct(std::vector<std::uint64_t> cells) {
  std::sort(cells.begin(), cells.end());
  return static_cast<std::size_t>(std::unique(cells.begin(), cells.end()) - cells.begin());
}

// The cells of the finest grid that has at most `most`.
std::vector<std::uint64_t> finest(const Cells& cells, std::size_t most) {
  double low = std::log(kSmallestCell * cells.extent()), high = std::log(2 * cells.extent());
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    (distinct(cells.of(std::exp(middle))) > most ? low : high) = middle;
  }
  return cells.of(std::exp(high));
}

// Appends the Gaussian that `members` of `g` become.
void add_merged(const Gaussians& g, std::span<const std::size_t> members, Gaussians& out) {
  double sum = 0;
  Vector3d mean = Vector3d::Zero();
  for (const std::size_t k : members) sum += absorbed(g, k), mean += absorbed(g, k) * centre_of(g, k);
  mean /= sum;
  Matrix3d spread = Matrix3d::Zero();
  const std::size_t coefficients = 3 * g.sh_count();
  Eigen::VectorXd sh = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(coefficients));
  for (const std::size_t k : members) {
    const Vector3d from_mean = centre_of(g, k) - mean;
    spread += absorbed(g, k) / sum * (covariance(g, k) + from_mean * from_mean.transpose());
    sh += absorbed(g, k) / sum * Eigen::Map<const Eigen::VectorXf>(&g.sh[coefficients * k], sh.size()).cast<double>();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(spread);
  const Vector3d scales = axes.eigenvalues().cwiseMax(0).cwiseSqrt();
  Matrix3d rotation = axes.eigenvectors();
  if (rotation.determinant() < 0) rotation = -rotation;
  const Eigen::Quaterniond q(rotation);
  for (int i = 0; i < 3; ++i) out.means.push_back(static_cast<float>(mean[i]));
  for (int i = 0; i < 3; ++i) out.scales.push_back(static_cast<float>(scales[i]));
  for (const double v : {q.w(), q.x(), q.y(), q.z()}) out.quats.push_back(static_cast<float>(v));
  out.opacities.push_back(static_cast<float>(std::min(opacity_of(sum / std::max(area(scales), 1e-30)), kHighOpacity)));
  for (const double v : sh) out.sh.push_back(static_cast<float>(v));
  ++out.count;
}

struct Group {
  std::span<const std::size_t> members;
  double absorbed = 0;
};

// One for each cell that absorbs anything. `order` receives the Gaussians by cell, which the groups are parts of.
std::vector<Group> groups_of(const Gaussians& g, const std::vector<std::uint64_t>& cell,
                             std::vector<std::size_t>& order) {
  order.resize(g.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&cell](std::size_t a, std::size_t b) { return cell[a] < cell[b]; });
  std::vector<Group> out;
  for (std::size_t first = 0; first < order.size();) {
    std::size_t end = first;
    double sum = 0;
    for (; end < order.size() && cell[order[end]] == cell[order[first]]; ++end) sum += absorbed(g, order[end]);
    if (sum > 0) out.push_back({std::span(order).subspan(first, end - first), sum});
    first = end;
  }
  return out;
}

Gaussians one_of_each(const Gaussians& g, const std::vector<Group>& groups) {
  Gaussians out;
  out.sh_degree = g.sh_degree;
  out.kind = g.kind;
  for (const Group& group : groups) add_merged(g, group.members, out);
  return out;
}

}  // namespace

Gaussians merged_in_cells(const Gaussians& gaussians, double edge) {
  if (gaussians.count == 0) return gaussians;
  std::vector<std::size_t> order;
  return one_of_each(gaussians, groups_of(gaussians, Cells(gaussians).of(edge), order));
}

Gaussians merged_gaussians(const Gaussians& gaussians, std::size_t most) {
  if (gaussians.count <= most) return gaussians;
  std::vector<std::size_t> order;
  std::vector<Group> groups = groups_of(
      gaussians, finest(Cells(gaussians), static_cast<std::size_t>(kSpare * static_cast<double>(most))), order);
  if (groups.size() > most) {
    std::stable_sort(groups.begin(), groups.end(),
                     [](const Group& a, const Group& b) { return a.absorbed > b.absorbed; });
    groups.resize(most);
  }
  return one_of_each(gaussians, groups);
}

Gaussians mean_of(const std::vector<Gaussians>& scenes) {
  Gaussians out = scenes.front();
  if (scenes.size() == 1) return out;
  for (std::size_t i = 1; i < scenes.size(); ++i) append(out, scenes[i]);
  const auto count = static_cast<double>(scenes.size());
  for (float& opacity : out.opacities) opacity = static_cast<float>(opacity_of(seen_depth(opacity) / count));
  return out;
}

}  // namespace vsplat

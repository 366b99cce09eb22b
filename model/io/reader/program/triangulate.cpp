#include "model/io/reader/program/triangulate.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace vsplat::read {
namespace {

struct Point {
  double x, y;
  bool operator==(const Point&) const = default;
};

// Twice the signed area.
double area(const Point& a, const Point& b, const Point& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// Projects the corners along the axis in which the normal is longest, seen from the side on which they turn left.
std::vector<Point> flattened(std::span<const std::array<float, 3>> corners) {
  std::array<double, 3> normal{};  // by Newell's method, which tolerates collinear corners
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto &a = corners[i], &b = corners[(i + 1) % corners.size()];
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t u = (k + 1) % 3, v = (k + 2) % 3;
      normal[k] += (static_cast<double>(a[u]) - b[u]) * (static_cast<double>(a[v]) + b[v]);
    }
  }
  std::size_t k = 0;
  for (std::size_t i = 1; i < 3; ++i)
    if (std::abs(normal[i]) > std::abs(normal[k])) k = i;
  const std::size_t u = (k + 1) % 3, v = (k + 2) % 3;
  const double side = normal[k] < 0 ? -1 : 1;
  std::vector<Point> out;
  out.reserve(corners.size());
  for (const auto& corner : corners) out.push_back({corner[u], side * corner[v]});
  return out;
}

// Cuts off ears until one triangle is left.
class Ring {
 public:
  explicit Ring(const std::vector<Point>& points) : points_(points), next_(points.size()), before_(points.size()) {
    const auto n = static_cast<std::uint32_t>(points.size());
    for (std::uint32_t i = 0; i < n; ++i) next_[i] = (i + 1) % n, before_[i] = (i + n - 1) % n;
  }

  std::vector<std::array<std::uint32_t, 3>> cut() {
    std::vector<std::array<std::uint32_t, 3>> out;
    std::uint32_t at = 0;
    for (std::size_t left = points_.size(); left > 3; --left) {
      const std::uint32_t ear = find_ear(at, left);
      out.push_back({before_[ear], ear, next_[ear]});
      next_[before_[ear]] = next_[ear], before_[next_[ear]] = before_[ear];
      at = next_[ear];
    }
    out.push_back({before_[at], at, next_[at]});
    return out;
  }

 private:
  // If there is no ear (edges cross, or all corners are collinear), returns the corner that turns least to the right.
  std::uint32_t find_ear(std::uint32_t from, std::size_t left) const {
    std::uint32_t best = from, at = from;
    double most = -HUGE_VAL;
    for (std::size_t i = 0; i < left; ++i, at = next_[at]) {
      const double size = area(points_[before_[at]], points_[at], points_[next_[at]]);
      if (size > 0 && is_empty(at)) return at;
      if (size > most) most = size, best = at;
    }
    return best;
  }

  // Whether no other corner lies inside the triangle or on its edges; corners that coincide with one of its corners do
  // not count.
  bool is_empty(std::uint32_t ear) const {
    const Point &a = points_[before_[ear]], &b = points_[ear], &c = points_[next_[ear]];
    for (std::uint32_t at = next_[next_[ear]]; at != before_[ear]; at = next_[at]) {
      const Point& p = points_[at];
      if (p == a || p == b || p == c) continue;
      if (area(a, b, p) >= 0 && area(b, c, p) >= 0 && area(c, a, p) >= 0) return false;
    }
    return true;
  }

  const std::vector<Point>& points_;
  std::vector<std::uint32_t> next_, before_;
};

bool is_convex(const std::vector<Point>& points) {
  const std::size_t n = points.size();
  for (std::size_t i = 0; i < n; ++i)
    if (area(points[i], points[(i + 1) % n], points[(i + 2) % n]) < 0) return false;
  return true;
}

}  // namespace

std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const std::array<float, 3>> corners) {
  const std::vector<Point> points = flattened(corners);
  if (!is_convex(points)) {
    if (corners.size() > most_concave_corners)
      throw std::length_error(fmt::format("a face that is not convex has {} corners; at most {} are read",
                                          corners.size(), most_concave_corners));
    return Ring(points).cut();
  }
  std::vector<std::array<std::uint32_t, 3>> out;
  for (std::uint32_t i = 2; i < points.size(); ++i) out.push_back({0, i - 1, i});
  return out;
}

}  // namespace vsplat::read

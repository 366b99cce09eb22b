#include "model/data/parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace vsplat {
namespace {

using Eigen::Vector3d;

constexpr int halvings = 24;  // of an edge, to locate its intersection to float precision

bool before(const Corner& a, const Corner& b) {
  return std::lexicographical_compare(a.position.data(), a.position.data() + 3, b.position.data(),
                                      b.position.data() + 3);
}

// The intersection of the edge with the border. The result does not depend on the edge's direction, so adjacent
// triangles stay connected.
Corner crossing(Corner a, Corner b, const Inside& inside) {
  if (before(b, a)) std::swap(a, b);
  const Vector3d p = a.position.cast<double>(), q = b.position.cast<double>();
  const bool first = inside(p) < 0;
  double low = 0, high = 1;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (low + high);
    (inside(p + middle * (q - p)) < 0 ? first : !first) ? low = middle : high = middle;
  }
  const double at = 0.5 * (low + high);
  const auto share = static_cast<float>(at);
  Corner out;
  out.position = (p + at * (q - p)).cast<float>();
  out.uv = a.uv + share * (b.uv - a.uv);
  out.colour = a.colour + share * (b.colour - a.colour);
  return out;
}

void turn_over(Triangles& triangles) {
  for (std::size_t i = 0; i + 2 < triangles.size(); i += 3) std::swap(triangles[i + 1], triangles[i + 2]);
}

// Directions perpendicular to a line at each of its points, propagated with minimal rotation from the first one. If the
// line is closed, the remaining rotation is distributed evenly.
struct Frame {
  Vector3d side, up;
};
std::vector<Frame> frames_of(std::span<const Vector3d> line, bool closed) {
  const std::size_t count = line.size();
  const auto ahead = [&](std::size_t i) {
    const std::size_t from = i > 0 ? i - 1 : (closed ? count - 1 : 0), to = i + 1 < count ? i + 1 : (closed ? 0 : i);
    const Vector3d d = line[to] - line[from];
    return d.norm() > 1e-12 ? Vector3d(d.normalized()) : Vector3d(Vector3d::UnitY());
  };
  std::vector<Frame> out(count);
  Vector3d direction = ahead(0), side = direction.unitOrthogonal();
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d now = ahead(i);
    side = Eigen::Quaterniond::FromTwoVectors(direction, now) * side;
    side = (side - side.dot(now) * now).normalized();
    direction = now;
    out[i] = {side, now.cross(side)};
  }
  if (!closed) return out;
  const Vector3d first = ahead(0);
  Vector3d back = Eigen::Quaterniond::FromTwoVectors(direction, first) * side;
  back = (back - back.dot(first) * first).normalized();
  const double off = std::atan2(back.cross(out[0].side).dot(first), back.dot(out[0].side));
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d along = ahead(i);
    const Eigen::AngleAxisd turn(off * static_cast<double>(i) / static_cast<double>(count), along);
    out[i] = {turn * out[i].side, turn * out[i].up};
  }
  return out;
}

Corner corner(const Vector3d& position, double u, double v) {
  Corner out;
  out.position = position.cast<float>();
  out.uv = {static_cast<float>(u), static_cast<float>(v)};
  return out;
}

void append_square(Triangles& out, const Corner& a, const Corner& b, const Corner& c, const Corner& d) {
  out.insert(out.end(), {a, c, b, a, d, c});
}

}  // namespace

Triangles tessellated(const Surface& surface, int around, int along) {
  const auto at = [&](int i, int j) {
    const double v = static_cast<double>(j) / along;
    // Both sides of the seam are bitwise the same point.
    return corner(surface(static_cast<double>(i % around) / around, v), static_cast<double>(i) / around, v);
  };
  std::vector<Corner> grid;
  for (int j = 0; j <= along; ++j)
    for (int i = 0; i <= around; ++i) grid.push_back(at(i, j));
  const auto point = [&](int i, int j) { return grid[static_cast<std::size_t>(j) * (around + 1) + i]; };
  Triangles out;
  for (int j = 0; j < along; ++j)
    for (int i = 0; i < around; ++i)
      append_square(out, point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
  return out;
}

Triangles part_of(const Triangles& from, const Inside& inside, bool within) {
  Triangles out;
  for (std::size_t i = 0; i + 2 < from.size(); i += 3) {
    std::array<bool, 3> kept{};
    for (int k = 0; k < 3; ++k) kept[k] = (inside(from[i + k].position.cast<double>()) < 0) == within;
    const auto count = std::count(kept.begin(), kept.end(), true);
    if (count == 0) continue;
    if (count == 3) {
      out.insert(out.end(), from.begin() + static_cast<std::ptrdiff_t>(i),
                 from.begin() + static_cast<std::ptrdiff_t>(i) + 3);
      continue;
    }
    int lone = 0;  // the corner that differs from the other two
    while (kept[lone] != (count == 1)) ++lone;
    const Corner &a = from[i + lone], &b = from[i + (lone + 1) % 3], &c = from[i + (lone + 2) % 3];
    const Corner ab = crossing(a, b, inside), ac = crossing(a, c, inside);
    if (count == 1)
      out.insert(out.end(), {a, ab, ac});
    else
      out.insert(out.end(), {ab, b, c, ab, c, ac});
  }
  return out;
}

Cut difference(const Body& body, const Body& cutter, const Eigen::Affine3d& place, int around, int along) {
  const Eigen::Affine3d back = place.inverse();
  const Inside cut = [&](const Vector3d& p) { return cutter.inside(back * p); };
  Triangles walls = tessellated(cutter.surface, around, along);
  warp(walls, [&](const Vector3d& p) { return place * p; });
  walls = part_of(walls, body.inside, true);
  turn_over(walls);
  return {part_of(tessellated(body.surface, around, along), cut, false), std::move(walls)};
}

Triangles tube(std::span<const Vector3d> line, bool closed, double radius, int sides) {
  const std::vector<Frame> frames = frames_of(line, closed);
  const int count = static_cast<int>(line.size()), rows = closed ? count : count - 1;
  const auto at = [&](int i, int j) {
    const double a = 2 * M_PI * (j % sides) / sides;
    const Frame& f = frames[static_cast<std::size_t>(i % count)];
    const Vector3d p = line[static_cast<std::size_t>(i % count)] + radius * (std::cos(a) * f.side + std::sin(a) * f.up);
    return corner(p, static_cast<double>(j) / sides, static_cast<double>(i) / rows);
  };
  Triangles out;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < sides; ++j) append_square(out, at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
  if (closed) return out;
  const Corner first = corner(line.front(), 0.5, 0), last = corner(line.back(), 0.5, 1);
  for (int j = 0; j < sides; ++j) {
    out.insert(out.end(), {first, at(0, j + 1), at(0, j)});
    out.insert(out.end(), {last, at(rows, j), at(rows, j + 1)});
  }
  return out;
}

Triangles wires(const Surface& surface, int around, int along, double radius) {
  constexpr int points = 48, sides = 6;
  Triangles out;
  const auto append = [&](const std::vector<Vector3d>& line, bool closed) {
    const Triangles one = tube(line, closed, radius, sides);
    out.insert(out.end(), one.begin(), one.end());
  };
  for (int i = 0; i < around; ++i) {
    std::vector<Vector3d> line;
    for (int k = 0; k <= points; ++k)
      line.push_back(surface(static_cast<double>(i) / around, static_cast<double>(k) / points));
    append(line, false);
  }
  for (int j = 1; j <= along; ++j) {
    std::vector<Vector3d> line;
    for (int k = 0; k < points; ++k)
      line.push_back(surface(static_cast<double>(k) / points, static_cast<double>(j) / (along + 1)));
    append(line, true);
  }
  return out;
}

void warp(Triangles& triangles, const Warp& by) {
  for (Corner& c : triangles) c.position = by(c.position.cast<double>()).cast<float>();
}

Warp twist(double per_unit) {
  return [=](const Vector3d& p) { return Eigen::AngleAxisd(per_unit * p.y(), Vector3d::UnitY()) * p; };
}

Warp bend(double per_unit) {
  if (std::abs(per_unit) < 1e-6) return [](const Vector3d& p) { return p; };
  return [=](const Vector3d& p) {
    const double radius = 1 / per_unit, angle = per_unit * p.y();
    return Vector3d(radius - (radius - p.x()) * std::cos(angle), (radius - p.x()) * std::sin(angle), p.z());
  };
}

Warp taper(double by) {
  return [=](const Vector3d& p) {
    const double wide = 1 + by * std::clamp(p.y(), -1.0, 1.0);
    return Vector3d(wide * p.x(), p.y(), wide * p.z());
  };
}

Warp bumps(double height, Random& random) {
  struct Wave {
    Vector3d along;
    double phase, share;
  };
  std::vector<Wave> waves;
  const double slowest = random.uniform(2, 5);
  double sum = 0;
  for (int k = 0; k < 6; ++k) {
    const double faster = 1 + 0.7 * k;
    waves.push_back({slowest * faster * random_rotation(random).col(0), random.uniform(0, 2 * M_PI), 1 / faster});
    sum += 1 / faster;
  }
  for (Wave& wave : waves) wave.share *= height / sum;
  return [=](const Vector3d& p) {
    if (!(p.norm() > 1e-9)) return p;
    const Vector3d direction = p.normalized();
    double by = 0;
    for (const Wave& wave : waves) by += wave.share * std::sin(wave.along.dot(direction) + wave.phase);
    return Vector3d((1 + by) * p);
  };
}

}  // namespace vsplat

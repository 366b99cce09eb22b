#include "model/data/random_object.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>

#include "model/data/parts.h"

namespace vsplat {
namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int most_parts = 9;
constexpr int around = 48, along = 32;  // of a body
constexpr int points = 64, sides = 8;   // of a tube

bool by_chance(Random& random, double share) { return random.uniform() < share; }

Vector3d random_size(Random& random, double low, double high) {
  Vector3d out;
  for (double& s : out) s = random.uniform(low, high);
  return out;
}

// Triangles that share a paint.
struct Piece {
  Triangles outside, walls;  // walls of a cut may have another paint
};

void warp(Piece& piece, const Warp& by) {
  warp(piece.outside, by);
  warp(piece.walls, by);
}

// A solid part, centred at the origin, within [-1,1]^3.
Piece random_mass(Random& random) {
  const Body body = random_body(random);
  Piece out;
  const double kind = random.uniform();
  if (kind < 0.15) {  // a bowl: the cut passes through its top
    const double wide = random.uniform(0.7, 0.92), deep = random.uniform(0.15, 0.8);
    const Body cutter = by_chance(random, 0.5) ? body : superellipsoid(0.1, 1.0);
    Cut cut = difference(body, cutter, Affine3d(Eigen::Translation3d(0, deep, 0) * Eigen::Scaling(wide, 1.0, wide)),
                         around, along);
    out = {std::move(cut.outside), std::move(cut.walls)};
  } else if (kind < 0.4) {
    const Body cutter = random_body(random);
    Vector3d offset;
    for (double& o : offset) o = random.uniform(-1, 1);
    const Matrix3d turn = by_chance(random, 0.5) ? random_rotation(random) : Matrix3d::Identity();
    Cut cut = difference(body, cutter,
                         Affine3d(Eigen::Translation3d(offset) * turn * Eigen::Scaling(random_size(random, 0.25, 0.9))),
                         around, along);
    out = {std::move(cut.outside), std::move(cut.walls)};
    if (out.outside.empty()) out = {tessellated(body.surface, around, along), {}};  // nothing was left
  } else {
    out.outside = tessellated(body.surface, around, along);
  }
  if (by_chance(random, 0.3)) warp(out, bumps(random.uniform(0.05, 0.35), random));
  if (by_chance(random, 0.25)) warp(out, taper(random.uniform(-0.7, 0.7)));
  return out;
}

// A curve roughly within [-1,1]^3: a half circle, a circle, a spring or a random curve.
struct Line {
  std::vector<Vector3d> points;
  bool closed = false;
};
Line random_line(Random& random) {
  Line out;
  const int kind = random.below(4);
  const double turns = random.uniform(1.5, 5), narrow = random.uniform(0.2, 0.7);
  Vector3d speed[3], phase[3];
  for (int k = 0; k < 3; ++k) speed[k] = random_size(random, 0.5, 1.5), phase[k] = random_size(random, 0, 2 * M_PI);
  out.closed = kind == 1;
  for (int i = 0; i < points; ++i) {
    const double t = static_cast<double>(i) / (out.closed ? points : points - 1);
    if (kind < 2) {
      const double a = (kind == 0 ? M_PI : 2 * M_PI) * t;
      out.points.emplace_back(std::cos(a), std::sin(a), 0);
    } else if (kind == 2) {
      const double a = 2 * M_PI * turns * t;
      out.points.emplace_back(narrow * std::cos(a), 2 * t - 1, narrow * std::sin(a));
    } else {
      Vector3d p = Vector3d::Zero();
      for (int k = 0; k < 3; ++k)
        for (int c = 0; c < 3; ++c) p[c] += std::sin((k + 1) * M_PI * speed[k][c] * t + phase[k][c]) / (1.5 * (k + 1));
      out.points.push_back(p);
    }
  }
  return out;
}

// A thin part of about that size. Its thickness is not scaled, so that all thin parts of an object are similar.
Piece random_thin(Random& random, const Vector3d& size) {
  const double thin = random.uniform(0.015, 0.06);
  const int kind = random.below(4);
  Triangles out;
  if (kind == 0) {  // a rod or a lath
    const Surface rod = superellipsoid(0.1, by_chance(random, 0.5) ? 1.0 : 0.15).surface;
    const Vector3d scale(thin, size.y(), thin * random.uniform(1, 2));
    out = tessellated([&](double u, double v) { return Vector3d(scale.cwiseProduct(rod(u, v))); }, 16, along);
  } else if (kind == 1) {  // a plate
    const Surface plate = superellipsoid(0.1, by_chance(random, 0.5) ? 1.0 : 0.15).surface;
    const Vector3d scale(size.x(), thin, size.z());
    out = tessellated([&](double u, double v) { return Vector3d(scale.cwiseProduct(plate(u, v))); }, around, along);
  } else {
    Line line = random_line(random);
    for (Vector3d& p : line.points) p = p.cwiseProduct(size);
    out = tube(line.points, line.closed, thin, sides);
  }
  return {std::move(out), {}};
}

class Builder {
 public:
  Builder(Random& random, const TextureFolder* textures) : random_(random), textures_(textures) {}

  void append_part(bool first);
  void warp_all(const Warp& by) {
    for (Corner& c : mesh_.corners) c.position = by(c.position.cast<double>()).cast<float>();
  }
  Mesh take() { return std::move(mesh_); }

 private:
  Piece random_piece(bool first, bool& is_thin);
  Vector3d random_place(bool first);
  Matrix3d random_attitude();
  void append(Triangles triangles, const Paint& paint);
  const Paint& some_paint();

  Random& random_;
  const TextureFolder* textures_;
  Mesh mesh_;
  std::vector<Paint> paints_;
};

Piece Builder::random_piece(bool first, bool& is_thin) {
  const Vector3d size = first ? random_size(random_, 0.35, 1) : random_size(random_, 0.12, 0.6);
  const double kind = (first ? 0.8 : 1) * random_.uniform();  // few objects are built around a thin part
  is_thin = kind >= 0.72;
  if (is_thin) return random_thin(random_, 1.5 * size);
  if (kind >= 0.6) {
    const Surface surface = random_body(random_).surface;
    const int lines = 4 + random_.below(7), hoops = 1 + random_.below(5);
    const double radius = random_.uniform(0.012, 0.04);
    return {wires([&](double u, double v) { return Vector3d(size.cwiseProduct(surface(u, v))); }, lines, hoops, radius),
            {}};
  }
  Piece out = random_mass(random_);
  warp(out, [&](const Vector3d& p) { return Vector3d(size.cwiseProduct(p)); });
  return out;
}

// Usually a point of an existing part, so that parts touch.
Vector3d Builder::random_place(bool first) {
  if (first) return Vector3d::Zero();
  if (by_chance(random_, 0.8)) {
    const auto at = static_cast<std::size_t>(random_.uniform() * static_cast<double>(mesh_.corners.size()));
    return mesh_.corners[at].position.cast<double>();
  }
  Vector3d out;
  for (double& o : out) o = random_.uniform(-0.6, 0.6);
  return out;
}

// Half of the parts are aligned with the axes.
Matrix3d Builder::random_attitude() {
  if (by_chance(random_, 0.5)) return random_rotation(random_);
  Matrix3d out = Matrix3d::Identity();
  const int axis = random_.below(3);  // the axis that becomes y
  for (int i = 0; i < axis; ++i) out = (Matrix3d() << 0, 0, 1, 1, 0, 0, 0, 1, 0).finished() * out;
  const double turn = by_chance(random_, 0.5) ? random_.uniform(0, 2 * M_PI) : 0.0;
  return Eigen::AngleAxisd(turn, Vector3d::UnitY()).toRotationMatrix() * out;
}

const Paint& Builder::some_paint() {
  if (!paints_.empty() && by_chance(random_, 0.25))
    return paints_[static_cast<std::size_t>(random_.below(static_cast<int>(paints_.size())))];
  paints_.push_back(random_paint(random_, textures_));
  return paints_.back();
}

void Builder::append(Triangles triangles, const Paint& paint) {
  apply(paint, triangles);
  const auto material = static_cast<std::uint32_t>(mesh_.palette.size());
  mesh_.palette.push_back(paint.material);
  mesh_.corners.insert(mesh_.corners.end(), triangles.begin(), triangles.end());
  mesh_.materials.insert(mesh_.materials.end(), triangles.size() / 3, material);
}

void Builder::append_part(bool first) {
  bool is_thin = false;
  Piece piece = random_piece(first, is_thin);
  if (by_chance(random_, 0.15)) warp(piece, twist(random_.uniform(-2, 2)));
  if (by_chance(random_, 0.15)) warp(piece, bend(random_.uniform(-1.2, 1.2)));
  const Affine3d place = Eigen::Translation3d(random_place(first)) * random_attitude();
  const int copies = !first && by_chance(random_, is_thin ? 0.5 : 0.12) ? 2 + random_.below(3) : 1;
  const Paint paint = some_paint();
  const Paint inner = piece.walls.empty() || by_chance(random_, 0.5) ? paint : some_paint();
  for (int i = 0; i < copies; ++i) {
    const Affine3d at = Eigen::AngleAxisd(2 * M_PI * i / copies, Vector3d::UnitY()) * place;
    Piece copy = piece;
    warp(copy, [&](const Vector3d& p) { return at * p; });
    append(std::move(copy.outside), paint);
    if (!copy.walls.empty()) append(std::move(copy.walls), inner);
  }
}

}  // namespace

Mesh random_object(std::uint64_t seed, std::uint32_t index, const TextureFolder* textures) {
  Random random(seed, index, object_stream);
  Builder builder(random, textures);
  const int parts = 1 + random.below(most_parts);
  for (int i = 0; i < parts; ++i) builder.append_part(i == 0);
  if (by_chance(random, 0.1)) builder.warp_all(twist(random.uniform(-1.2, 1.2)));
  if (by_chance(random, 0.1)) builder.warp_all(bend(random.uniform(-0.8, 0.8)));
  Mesh out = builder.take();
  out.name = fmt::format("object {} of seed {}", index, seed);
  compute_normals(out);
  return out;
}

}  // namespace vsplat

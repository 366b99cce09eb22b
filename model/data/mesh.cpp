#include "model/data/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

#include "model/base/image.h"
#include "model/base/surface_mesh.h"
#include "model/io/picture/image_file.h"
#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float crease_cosine = 0.70710678f;  // 45 degrees
// If more corners meet in a point, all of them are averaged, because pairwise comparison would take too long.
constexpr std::size_t max_compared = 1024;

const std::array<float, 256>& linear_of_byte() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> out{};
    for (int i = 0; i < 256; ++i) out[i] = srgb_decode(static_cast<float>(i) / 255.0f);
    return out;
  }();
  return table;
}

bool before(const Vector3f& a, const Vector3f& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

// The two texels beside a texture coordinate, and the weight of the second.
struct Neighbours {
  int first, second;
  float share;
};
Neighbours neighbours(float coordinate, int size, Beyond beyond, bool nearest) {
  float inside = coordinate - std::floor(coordinate);  // may round up to 1
  if (beyond == Beyond::clamp) inside = std::clamp(coordinate, 0.0f, 1.0f);
  if (beyond == Beyond::mirror && std::fmod(std::floor(coordinate), 2.0f) != 0) inside = 1 - inside;
  const float at = inside * static_cast<float>(size) - 0.5f;
  const float low = std::floor(nearest ? at + 0.5f : at);
  const auto texel = [&](int i) { return beyond == Beyond::repeat ? (i + size) % size : std::clamp(i, 0, size - 1); };
  const int first = texel(static_cast<int>(low));
  if (nearest) return {first, first, 0};
  return {first, texel(static_cast<int>(low) + 1), at - low};
}

// Twice the area times the unit normal, in double, so that small triangles with large coordinates keep their direction.
Vector3d area_normal(const Mesh& mesh, std::size_t triangle) {
  const Corner* c = &mesh.corners[3 * triangle];
  const Vector3d a = c[0].position.cast<double>();
  return (c[1].position.cast<double>() - a).cross(c[2].position.cast<double>() - a);
}

Vector3f unit(const Vector3d& v) {
  const double length = v.norm();
  return length > 0 && std::isfinite(length) ? Vector3f((v / length).cast<float>()) : Vector3f(Vector3f::Zero());
}

}  // namespace

Mesh with_corners(const SurfaceMesh& surface) {
  Mesh out;
  out.palette.emplace_back();
  out.materials.assign(surface.triangle_count(), 0);
  out.corners.reserve(surface.triangles.size());
  for (const std::uint32_t vertex : surface.triangles) {
    const std::size_t at = 3 * static_cast<std::size_t>(vertex);
    Corner corner;
    corner.position = Eigen::Map<const Vector3f>(&surface.positions[at]);
    corner.normal = Eigen::Map<const Vector3f>(&surface.normals[at]);
    for (std::size_t c = 0; c < 3; ++c)
      corner.colour[static_cast<Eigen::Index>(c)] = srgb_decode(surface.colours[at + c]);
    out.corners.push_back(corner);
  }
  return out;
}

std::shared_ptr<const Texture> texture_of(const Image& picture) {
  ImageRows rows(picture);
  return texture_of(rows);
}

std::shared_ptr<const Texture> texture_of(PixelRows& picture) {
  auto out = std::make_shared<Texture>();
  out->width = picture.width;
  out->height = picture.height;
  const std::size_t pixels = static_cast<std::size_t>(picture.width) * picture.height;
  out->rgb.reserve(3 * pixels);
  if (picture.channels == 4) out->alpha.reserve(pixels);
  Image row(picture.width, 1, picture.channels);
  for (int y = 0; y < picture.height; ++y) {
    picture.next(row.data.data());
    const std::vector<unsigned char> bytes = rounded(row);
    for (std::size_t i = 0; i < bytes.size(); i += picture.channels) {
      out->rgb.insert(out->rgb.end(), &bytes[i], &bytes[i] + 3);
      if (picture.channels == 4) out->alpha.push_back(bytes[i + 3]);
    }
  }
  return out;
}

Vector3f sample(const Texture& texture, const Eigen::Vector2f& uv, const Sampling& sampling) {
  const Neighbours x = neighbours(uv.x(), texture.width, sampling.u, sampling.nearest);
  const Neighbours y = neighbours(1.0f - uv.y(), texture.height, sampling.v, sampling.nearest);
  const std::array<float, 256>& linear = linear_of_byte();
  const auto texel = [&](int column, int row) {
    const unsigned char* p = &texture.rgb[3 * (static_cast<std::size_t>(row) * texture.width + column)];
    return Vector3f(linear[p[0]], linear[p[1]], linear[p[2]]);
  };
  const Vector3f upper = (1 - x.share) * texel(x.first, y.first) + x.share * texel(x.second, y.first);
  const Vector3f lower = (1 - x.share) * texel(x.first, y.second) + x.share * texel(x.second, y.second);
  return (1 - y.share) * upper + y.share * lower;
}

float sample_alpha(const Texture& texture, const Eigen::Vector2f& uv, const Sampling& sampling) {
  if (texture.alpha.empty()) return 1;
  const Neighbours x = neighbours(uv.x(), texture.width, sampling.u, sampling.nearest);
  const Neighbours y = neighbours(1.0f - uv.y(), texture.height, sampling.v, sampling.nearest);
  const auto texel = [&](int column, int row) {
    return static_cast<float>(texture.alpha[static_cast<std::size_t>(row) * texture.width + column]) / 255.0f;
  };
  const float upper = (1 - x.share) * texel(x.first, y.first) + x.share * texel(x.second, y.first);
  const float lower = (1 - x.share) * texel(x.first, y.second) + x.share * texel(x.second, y.second);
  return (1 - y.share) * upper + y.share * lower;
}

void compute_normals(Mesh& mesh) {
  const std::vector<Corner>& corners = mesh.corners;
  if (std::none_of(corners.begin(), corners.end(), [](const Corner& c) { return c.normal.isZero(0); })) return;
  std::vector<Vector3d> faces(mesh.triangles());
  std::vector<Vector3f> directions(mesh.triangles());
  for (std::size_t t = 0; t < faces.size(); ++t) {
    faces[t] = area_normal(mesh, t);
    directions[t] = unit(faces[t]);
  }
  std::vector<std::size_t> order(corners.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (corners[a].position != corners[b].position) return before(corners[a].position, corners[b].position);
    return a < b;  // fixes the order of summation
  });
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    while (end < order.size() && corners[order[end]].position == corners[order[begin]].position) ++end;
    const std::span<const std::size_t> group(&order[begin], end - begin);
    Vector3d whole = Vector3d::Zero();
    for (const std::size_t corner : group) whole += faces[corner / 3];
    for (const std::size_t corner : group) {
      if (!corners[corner].normal.isZero(0)) continue;
      Vector3d sum = Vector3d::Zero();
      if (group.size() > max_compared)
        sum = whole;
      else
        for (const std::size_t other : group)
          if (directions[corner / 3].dot(directions[other / 3]) > crease_cosine) sum += faces[other / 3];
      mesh.corners[corner].normal = unit(sum);
    }
  }
}

void fit_into_cube(Mesh& mesh) {
  if (mesh.triangles() == 0) fail(Status::input, "{}: has no faces; a mesh of triangles is expected", mesh.name);
  const float most = std::numeric_limits<float>::max();
  Vector3d low = Vector3d::Constant(most), high = Vector3d::Constant(-most);
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) {
    const Vector3d p = mesh.corners[i].position.cast<double>();
    if (!p.allFinite())
      fail(Status::input, "{}: face {} has a corner at {}, {}, {}; finite coordinates are expected", mesh.name, i / 3,
           p.x(), p.y(), p.z());
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double extent = (high - low).maxCoeff();
  if (!(extent > 1e-30))
    fail(Status::input, "{}: all its corners are at one point; a mesh with an extent is expected", mesh.name);
  const Vector3d centre = 0.5 * (low + high);
  for (Corner& c : mesh.corners) {
    const Vector3f moved = ((c.position.cast<double>() - centre) / extent).cast<float>();
    c.position = moved.cwiseMax(-0.5f).cwiseMin(0.5f);
  }
}

double radius_of(const Mesh& mesh) {
  double most = 0;
  for (const Corner& c : mesh.corners) most = std::max(most, c.position.cast<double>().squaredNorm());
  return std::sqrt(most);
}

}  // namespace vsplat

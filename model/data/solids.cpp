#include "model/data/solids.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "model/base/image.h"
#include "model/data/random.h"

namespace vsplat {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int around = 64, along = 40, texels = 128;

// A closed surface over (u, v) in [0,1]^2, u going round.
using Surface = std::function<Vector3d(double, double)>;

double signed_power(double x, double exponent) { return std::copysign(std::pow(std::abs(x), exponent), x); }

Surface superellipsoid(double upright, double round) {
  return [=](double u, double v) {
    const double a = 2 * M_PI * u, b = M_PI * (v - 0.5);
    const double level = v <= 0 || v >= 1 ? 0.0 : signed_power(std::cos(b), upright);
    return Vector3d(level * signed_power(std::cos(a), round), signed_power(std::sin(b), upright),
                    level * signed_power(std::sin(a), round));
  };
}

Surface ring(double thickness) {
  return [=](double u, double v) {
    const double a = 2 * M_PI * u, b = v < 1 ? 2 * M_PI * v : 0.0, r = 1 - thickness + thickness * std::cos(b);
    return Vector3d(r * std::cos(a), thickness * std::sin(b), r * std::sin(a));
  };
}

// A body of revolution whose profile is a sum of three waves, closed at both ends.
Surface vase(Random& random) {
  std::array<double, 3> wave{}, phase{};
  for (int k = 0; k < 3; ++k) wave[k] = random.uniform(0.05, 0.25), phase[k] = random.uniform(0, 2 * M_PI);
  return [=](double u, double v) {
    double r = 0.55;
    for (int k = 0; k < 3; ++k) r += wave[k] / (k + 1) * std::sin(2 * (k + 1) * v * M_PI + phase[k]);
    if (v <= 0 || v >= 1) r = 0;
    const double a = 2 * M_PI * u;
    return Vector3d(r * std::cos(a), 2 * v - 1, r * std::sin(a));
  };
}

Surface random_surface(Random& random) {
  switch (random.below(6)) {
    case 0:
      return superellipsoid(0.15, 0.15);  // a box
    case 1:
      return superellipsoid(0.1, 1.0);  // a cylinder
    case 2:
      return superellipsoid(1.0, 1.0);  // a ball
    case 3:
      return ring(random.uniform(0.2, 0.45));
    case 4:
      return vase(random);
    default:
      return superellipsoid(random.uniform(0.3, 1.8), random.uniform(0.3, 1.8));
  }
}

Matrix3d random_rotation(Random& random) {  // Shoemake's uniform quaternions
  const double a = random.uniform(), b = random.uniform(0, 2 * M_PI), c = random.uniform(0, 2 * M_PI);
  return Eigen::Quaterniond(std::sqrt(a) * std::cos(c), std::sqrt(1 - a) * std::sin(b), std::sqrt(1 - a) * std::cos(b),
                            std::sqrt(a) * std::sin(c))
      .normalized()
      .toRotationMatrix();
}

Vector3f random_colour(Random& random) {  // a hue, from grey to saturated, from dark to light
  const double hue = random.uniform(0, 6), saturation = std::sqrt(random.uniform()), value = random.uniform(0.25, 1);
  Vector3f out;
  for (int c = 0; c < 3; ++c) {
    const double ramp = std::clamp(std::abs(std::fmod(hue + 2.0 * c, 6.0) - 3) - 1, 0.0, 1.0);
    out[c] = static_cast<float>(value * (1 - saturation + saturation * ramp));
  }
  return out;
}

// [0,1] at (u, v): how much of the second colour.
using Pattern = std::function<double(double, double)>;

Pattern random_pattern(Random& random) {
  const int kind = random.below(4), n = 2 + 2 * random.below(4), m = 1 + random.below(5);
  std::array<double, 12> r{};
  for (double& v : r) v = random.uniform();
  const auto clouds = [=](double u, double v) {
    double sum = 0;
    for (int k = 0; k < 4; ++k)
      sum +=
          std::sin(2 * M_PI * ((k + 1) * u + r[3 * k])) * std::sin(2 * M_PI * ((m + k) * v + r[3 * k + 1])) / (k + 1);
    return std::clamp(0.5 + 0.6 * sum, 0.0, 1.0);
  };
  const auto checks = [=](double u, double v) {
    return static_cast<double>((static_cast<int>(n * u) + static_cast<int>(n * v)) % 2);
  };
  const auto stripes = [=](double u, double v) { return std::fmod(m * u + n * v, 1.0) < 0.3 + 0.4 * r[0] ? 1.0 : 0.0; };
  const auto spots = [=](double u, double v) {
    const double x = std::fmod(n * u, 1.0) - 0.5, y = std::fmod(n * v, 1.0) - 0.5;
    return std::hypot(x, y) < 0.2 + 0.2 * r[0] ? 1.0 : 0.0;
  };
  if (kind == 0) return checks;
  if (kind == 1) return stripes;
  if (kind == 2) return spots;
  return clouds;
}

std::shared_ptr<const Texture> random_texture(Random& random) {
  const Vector3f first = random_colour(random), second = random_colour(random);
  const Pattern pattern = random_pattern(random);
  Image picture(texels, texels, 3);
  for (int y = 0; y < texels; ++y)
    for (int x = 0; x < texels; ++x) {
      const auto share = static_cast<float>(pattern((x + 0.5) / texels, (y + 0.5) / texels));
      for (int c = 0; c < 3; ++c) picture.at(x, y)[c] = (1 - share) * first[c] + share * second[c];
    }
  return texture_of(picture);
}

Corner corner_at(const Surface& surface, const Matrix3d& linear, const Vector3d& offset, int i, int j) {
  Corner out;
  // The seam's two sides are the same point to the bit, so that normals are averaged across it.
  const Vector3d p = surface(static_cast<double>(i % around) / around, static_cast<double>(j) / along);
  out.position = (linear * p + offset).cast<float>();
  out.uv = {static_cast<float>(i) / around, static_cast<float>(j) / along};
  return out;
}

void append_part(Mesh& mesh, Random& random, bool first) {
  const Surface surface = random_surface(random);
  Vector3d size, offset;
  for (double& s : size) s = random.uniform(0.25, first ? 1.0 : 0.7);
  for (double& o : offset) o = first ? 0.0 : random.uniform(-0.6, 0.6);
  const Matrix3d linear = random_rotation(random) * size.asDiagonal();
  const auto material = static_cast<std::uint32_t>(mesh.palette.size());
  mesh.palette.push_back({Vector3f::Ones(), random_texture(random)});
  for (int j = 0; j < along; ++j)
    for (int i = 0; i < around; ++i) {
      const Corner a = corner_at(surface, linear, offset, i, j), b = corner_at(surface, linear, offset, i + 1, j),
                   c = corner_at(surface, linear, offset, i + 1, j + 1),
                   d = corner_at(surface, linear, offset, i, j + 1);
      mesh.corners.insert(mesh.corners.end(), {a, c, b, a, d, c});
      mesh.materials.insert(mesh.materials.end(), 2, material);
    }
}

}  // namespace

Mesh random_solid(std::uint64_t seed, std::uint32_t index) {
  Random random(seed, index, solid_stream);
  Mesh out;
  out.name = fmt::format("solid {} of seed {}", index, seed);
  const int parts = 1 + random.below(4);
  for (int i = 0; i < parts; ++i) append_part(out, random, i == 0);
  compute_normals(out);
  return out;
}

}  // namespace vsplat

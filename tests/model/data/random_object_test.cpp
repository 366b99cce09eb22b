// Random objects: cuts, bends and colours are as requested, every object is usable for training, and equal numbers give
// the same object.
#include "model/data/random_object.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "model/data/endless_objects.h"
#include "model/data/parts.h"
#include "model/io/picture/image_file.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using Eigen::Affine3d;
using Eigen::Vector3d;
using test::TemporaryFolder;

struct Closedness {
  Vector3d area = Vector3d::Zero();  // as vectors: the sum is 0 for a closed surface
  double whole = 0, volume = 0;
};
Closedness closedness(const Triangles& triangles) {
  Closedness out;
  for (std::size_t i = 0; i < triangles.size(); i += 3) {
    const Vector3d a = triangles[i].position.cast<double>(), b = triangles[i + 1].position.cast<double>(),
                   c = triangles[i + 2].position.cast<double>();
    const Vector3d face = 0.5 * (b - a).cross(c - a);
    out.area += face;
    out.whole += face.norm();
    out.volume += face.dot(a) / 3;
  }
  return out;
}

Triangles together(const Cut& cut) {
  Triangles out = cut.outside;
  out.insert(out.end(), cut.walls.begin(), cut.walls.end());
  return out;
}

TEST(Bodies, AreInsideWhatTheirSurfaceEncloses) {
  for (std::uint32_t i = 0; i < 40; ++i) {
    Random random(1, i, object_stream);
    const Body body = random_body(random);
    for (const double u : {0.0, 0.13, 0.5, 0.77})
      for (const double v : {0.1, 0.3, 0.5, 0.9}) {
        const Vector3d p = body.surface(u, v);
        EXPECT_LE(p.cwiseAbs().maxCoeff(), 1.3);
        EXPECT_NEAR(body.inside(p), 0, 1e-6) << i;
      }
    EXPECT_GT(body.inside(Vector3d(1.4, 1.4, 1.4)), 0);
  }
}

// A ball of half the size, cut out of the middle of a box's side, reduces the box by half of that ball.
TEST(Parts, ADifferenceIsClosedAndLessByWhatWasCutOut) {
  const Body box = superellipsoid(0.1, 0.1), ball = superellipsoid(1, 1);
  const double whole = closedness(tessellated(box.surface, 96, 64)).volume;
  const double half = 2.0 / 3 * M_PI * 0.125;
  EXPECT_NEAR(whole, 8, 0.1) << "seen from outside, the volume is above 0";
  const Cut cut = difference(box, ball, Affine3d(Eigen::Translation3d(0, 1, 0) * Eigen::Scaling(0.5)), 96, 64);
  const Closedness left = closedness(together(cut));
  EXPECT_NEAR(left.volume, whole - half, 0.02);
  EXPECT_LT(left.area.norm(), 0.005 * left.whole) << "it has a hole";
  for (const Corner& c : cut.walls) EXPECT_LT(box.inside(c.position.cast<double>()), 1e-3);
  for (const Corner& c : cut.outside)
    EXPECT_GT((c.position.cast<double>() - Vector3d(0, 1, 0)).norm(), 0.5 - 1e-3) << "within what was cut out";
  const Cut beside = difference(box, ball, Affine3d(Eigen::Translation3d(0, 3, 0)), 24, 16);
  EXPECT_TRUE(beside.walls.empty());
  EXPECT_EQ(beside.outside.size(), tessellated(box.surface, 24, 16).size());
}

TEST(Parts, TubesAreRoundTheirLine) {
  std::vector<Vector3d> line;
  for (int i = 0; i < 64; ++i) {
    const double a = 2 * M_PI * i / 64;
    line.emplace_back(std::cos(a), std::sin(a), 0.3 * std::sin(2 * a));
  }
  for (const bool closed : {true, false}) {
    const Triangles triangles = tube(line, closed, 0.1, 12);
    const Closedness is = closedness(triangles);
    EXPECT_LT(is.area.norm(), 1e-5 * is.whole) << closed;
    double length = closed ? (line.back() - line.front()).norm() : 0;
    for (std::size_t i = 1; i < line.size(); ++i) length += (line[i] - line[i - 1]).norm();
    EXPECT_NEAR(is.volume, length * M_PI * 0.01, 0.1 * length * M_PI * 0.01) << closed;
    for (const Corner& c : triangles) {
      double nearest = 9;
      for (const Vector3d& p : line) nearest = std::min(nearest, (p - c.position.cast<double>()).norm());
      EXPECT_LT(nearest, 0.1 + 1e-6);
    }
  }
  EXPECT_GT(wires(superellipsoid(1, 1).surface, 5, 3, 0.02).size(), 3u * 1000);
}

TEST(Parts, WarpsDoWhatTheySay) {
  EXPECT_TRUE(twist(M_PI / 2)(Vector3d(1, 1, 0)).isApprox(Vector3d(0, 1, -1), 1e-12));
  EXPECT_TRUE(bend(0)(Vector3d(1, 2, 3)).isApprox(Vector3d(1, 2, 3)));
  const Vector3d bent = bend(M_PI / 2)(Vector3d(0, 1, 0.5));  // a quarter of a circle about (2 / pi, 0)
  EXPECT_TRUE(bent.isApprox(Vector3d(2 / M_PI, 2 / M_PI, 0.5), 1e-12));
  EXPECT_TRUE(taper(0.5)(Vector3d(1, 1, 1)).isApprox(Vector3d(1.5, 1, 1.5)));
  Random random(3, 0, object_stream);
  const Warp field = bumps(0.2, random);
  double least = 9, most = 0;
  for (int i = 0; i < 400; ++i) {
    const Vector3d direction = random_rotation(random).col(0), moved = field(direction);
    EXPECT_LT(moved.cross(direction).norm(), 1e-9) << "along the direction alone";
    least = std::min(least, moved.norm()), most = std::max(most, moved.norm());
  }
  EXPECT_GT(least, 0.8 - 1e-9);
  EXPECT_LT(most, 1.2 + 1e-9);
  EXPECT_GT(most - least, 0.05);
}

bool same(const Mesh& a, const Mesh& b) {
  return a.materials == b.materials && a.corners.size() == b.corners.size() &&
         std::equal(a.corners.begin(), a.corners.end(), b.corners.begin(), [](const Corner& x, const Corner& y) {
           return x.position == y.position && x.normal == y.normal && x.colour == y.colour && x.uv == y.uv;
         });
}

TEST(RandomObject, IsFiniteAndTheSameForItsNumbers) {
  std::set<std::size_t> sizes;
  std::size_t textured = 0, gradients = 0, plain = 0;
  for (std::uint32_t i = 0; i < 48; ++i) {
    const Mesh mesh = random_object(2, i, nullptr);
    ASSERT_GT(mesh.triangles(), 0u);
    EXPECT_LT(mesh.triangles(), 200'000u);
    sizes.insert(mesh.palette.size());
    double normals = 0;
    for (const Corner& c : mesh.corners) {
      ASSERT_TRUE(c.position.allFinite() && c.normal.allFinite() && c.uv.allFinite()) << i;
      normals += c.normal.norm();
    }
    EXPECT_GT(normals, 0.9 * static_cast<double>(mesh.corners.size())) << i;
    for (const Material& material : mesh.palette) (material.texture ? textured : plain) += 1;
    gradients += std::any_of(mesh.corners.begin(), mesh.corners.end(),
                             [](const Corner& c) { return c.colour != Eigen::Vector3f::Ones(); })
                     ? 1
                     : 0;
    Mesh fitted = mesh;
    EXPECT_NO_THROW(fit_into_cube(fitted)) << i;
    if (i > 11) continue;
    EXPECT_TRUE(same(random_object(2, i, nullptr), mesh)) << i;
    EXPECT_FALSE(same(random_object(3, i, nullptr), mesh)) << i;
    EXPECT_FALSE(same(random_object(2, i + 1, nullptr), mesh)) << i;
  }
  EXPECT_GE(sizes.size(), 8u) << "numbers of painted parts";
  EXPECT_GT(textured, 10u);
  EXPECT_GT(gradients, 5u);
  EXPECT_GT(plain, 10u);
}

TEST(RandomObject, TakesTexturesFromAFolder) {
  const TemporaryFolder folder;
  test::expect_error(Status::file, {"gone"}, [&] { TextureFolder(folder / "gone"); });
  test::expect_error(Status::input, {"no picture"}, [&] { TextureFolder(folder.string()); });
  test::put_file(folder / "notes.txt", "no picture");
  Image red(1024, 256, 3), clear(8, 8, 4, 0.0f);
  for (std::size_t i = 0; i < red.data.size(); i += 3) red.data[i] = 1;
  write_png(folder / "b.png", red);
  write_png(folder / "a.png", clear);
  const TextureFolder textures(folder.string());
  ASSERT_EQ(textures.count(), 2u);
  EXPECT_EQ(textures.at(1)->width, 512);
  EXPECT_EQ(textures.at(1)->height, 128);
  EXPECT_EQ(sample(*textures.at(1), {0.3f, 0.4f}), Eigen::Vector3f(1, 0, 0));
  EXPECT_EQ(sample(*textures.at(0), {0.3f, 0.4f}), Eigen::Vector3f(1, 1, 1)) << "on white: a surface has no holes";
  EXPECT_EQ(textures.at(1), textures.at(1)) << "read once";
  std::size_t covered = 0, all = 0;
  for (std::uint32_t i = 0; i < 20; ++i)
    for (const Material& material : random_object(2, i, &textures).palette) {
      ++all;
      covered += material.texture == textures.at(0) || material.texture == textures.at(1) ? 1 : 0;
    }
  EXPECT_NEAR(static_cast<double>(covered) / static_cast<double>(all), 0.5, 0.2);
}

TEST(EndlessShare, IsSpreadEvenly) {
  for (const double part : {0.0, 0.25, 0.3, 1.0 / 3, 0.5, 0.9, 1.0}) {
    const EndlessShare share(part);
    std::uint64_t random = 0, others = 0;
    for (std::uint64_t i = 0; i < 3000; ++i) {
      EXPECT_EQ(share.others_before(i), others) << part << " " << i;
      (share.is_random(i) ? random : others) += 1;
      EXPECT_LT(std::abs(static_cast<double>(random) - part * static_cast<double>(i + 1)), 1 + 1e-9) << part;
    }
  }
}

}  // namespace
}  // namespace vsplat

#include "model/base/axes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <cstddef>
#include <string>

#include "model/base/scene.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "runtime/error.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// By hand: a place 1 right, 2 up and 3 forward of the origin.
TEST(Axes, CoordinatesOfOnePlace) {
  const Vector3d rdf(1, -2, 3);
  EXPECT_EQ(change_of_axes("RDF", "RUB") * rdf, Vector3d(1, 2, -3));
  EXPECT_EQ(change_of_axes("RDF", "LUF") * rdf, Vector3d(-1, 2, 3));
  EXPECT_EQ(change_of_axes("RDF", "RFU") * rdf, Vector3d(1, 3, 2));
  EXPECT_EQ(change_of_axes("RDF", "FLU") * rdf, Vector3d(3, -1, 2));
  EXPECT_EQ(change_of_axes("RDF", "RUF") * rdf, Vector3d(1, 2, 3));
  EXPECT_EQ(change_of_axes("rdf", "RDF"), Matrix3d(Matrix3d::Identity()));
  EXPECT_EQ(change_of_axes("RUB", "RDF") * change_of_axes("RDF", "RUB"), Matrix3d(Matrix3d::Identity()));
}

TEST(Axes, HandsAndUp) {
  for (const char* right : {"RDF", "RUB", "LUF", "FLU", "RFU"}) EXPECT_EQ(axes_of(right).determinant(), 1) << right;
  for (const char* left : {"RUF", "LUB", "RDB"}) EXPECT_EQ(axes_of(left).determinant(), -1) << left;
  EXPECT_EQ(up_of_axes("RDF"), Vector3d(0, -1, 0));
  EXPECT_EQ(up_of_axes("RFU"), Vector3d(0, 0, 1));
}

TEST(Axes, RefusesOtherLetters) {
  for (const char* wrong : {"", "RD", "RDFU", "RLF", "RDX", "RRR", "R D", "123"})
    EXPECT_THROW(axes_of(wrong), Error) << wrong;
}

Matrix3d covariance(const Gaussians& g, std::size_t k) {
  const Eigen::Quaterniond q(g.quats[4 * k], g.quats[4 * k + 1], g.quats[4 * k + 2], g.quats[4 * k + 3]);
  const auto axes = static_cast<std::size_t>(scales_of(g.kind));
  Vector3d s = Vector3d::Zero();
  for (std::size_t i = 0; i < axes; ++i) s[static_cast<Eigen::Index>(i)] = static_cast<double>(g.scales[axes * k + i]);
  const Matrix3d a = q.toRotationMatrix() * s.asDiagonal();
  return a * a.transpose();
}

// Every change of axes, of either hand: places, ellipsoids and colours go along, and quaternions stay of length 1. The
// colours are those of the reference's basis.
TEST(Axes, ScenesGoAlong) {
  for (const GaussianKind kind : {GaussianKind::volume, GaussianKind::surfel})
    for (const char* to : {"RUB", "RFU", "RUF", "BDL", "UFR"}) {
      Scene scene;
      scene.gaussians = kind == GaussianKind::volume ? test::make_scene({"", 12, 3, 0, 0, ""}, 3)
                                                     : test::make_surfels({"", 12, 3, 0, 0, ""}, 3);
      scene.up = {0, -1, 0};
      Scene moved = scene;
      Similarity move;
      move.rotation = change_of_axes("RDF", to);
      transform(moved, move);
      EXPECT_LT((Vector3d((*moved.up)[0], (*moved.up)[1], (*moved.up)[2]) - up_of_axes(to)).norm(), 1e-6);
      const Gaussians &before = scene.gaussians, &after = moved.gaussians;
      for (std::size_t k = 0; k < before.count; ++k) {
        const Vector3d mean = Eigen::Map<const Eigen::Vector3f>(&before.means[3 * k]).cast<double>(),
                       there = Eigen::Map<const Eigen::Vector3f>(&after.means[3 * k]).cast<double>();
        EXPECT_LT((move.rotation * mean - there).norm(), 1e-6) << to;
        const Matrix3d want = move.rotation * covariance(before, k) * move.rotation.transpose();
        EXPECT_LT((covariance(after, k) - want).norm(), 1e-5 * want.norm()) << to;
        EXPECT_NEAR(Eigen::Map<const Eigen::Vector4f>(&after.quats[4 * k]).norm(), 1, 1e-6);
        const Vector3d seen_from = Vector3d(0.3 * static_cast<double>(k), 1, -2).normalized();
        const auto from = ref::basis(seen_from, 16), from_there = ref::basis(move.rotation * seen_from, 16);
        for (std::size_t c = 0; c < 3; ++c) {
          double colour = 0, colour_there = 0;
          for (std::size_t m = 0; m < 16; ++m) {
            colour += from[m] * static_cast<double>(before.sh[(16 * k + m) * 3 + c]);
            colour_there += from_there[m] * static_cast<double>(after.sh[(16 * k + m) * 3 + c]);
          }
          EXPECT_NEAR(colour, colour_there, 1e-5) << to;
        }
      }
    }
}

}  // namespace
}  // namespace vsplat

#include "model/base/lens.h"

#include <gtest/gtest.h>

#include <cmath>

namespace vsplat {
namespace {

Distortion opencv(std::initializer_list<double> k) {
  Distortion d{Distortion::Model::opencv, {}};
  std::copy(k.begin(), k.end(), d.k);
  return d;
}

TEST(Lens, ReachesAsFarAsItGrows) {
  EXPECT_TRUE(reaches({}, 1e3));
  const Distortion barrel{Distortion::Model::opencv, {-0.3}};  // r - 0.3 r^3 has its maximum at r = 1.054: 0.703
  EXPECT_TRUE(reaches(barrel, 0.69));
  EXPECT_FALSE(reaches(barrel, 0.71));
  EXPECT_FALSE(reaches({Distortion::Model::opencv, {-1e6}}, 0.1));
  EXPECT_TRUE(reaches({Distortion::Model::opencv, {0.5}}, 2));
  EXPECT_TRUE(reaches({Distortion::Model::fisheye, {}}, 1.5));  // the angle itself, below a right angle
  EXPECT_FALSE(reaches({Distortion::Model::fisheye, {}}, 1.6));
  EXPECT_FALSE(reaches({Distortion::Model::fisheye, {-1}}, 0.5));  // theta - theta^3: 0.385
}

TEST(Lens, ReachesInAsManyStepsForAnyRadius) {
  for (const auto model : {Distortion::Model::fisheye, Distortion::Model::opencv})
    for (const double radius : {1e-300, 1e-12}) EXPECT_TRUE(reaches({model, {0.1}}, radius));
}

TEST(Lens, FollowsTheRationalModelTermByTerm) {
  const double k1 = 0.1, k2 = -0.02, p1 = 0.003, p2 = -0.004, k3 = 0.005, k4 = 0.06, k5 = 0.007, k6 = -0.001;
  const Lens lens(opencv({k1, k2, p1, p2, k3, k4, k5, k6}), 2);
  for (const double x : {-0.7, 0.0, 0.3})
    for (const double y : {-0.4, 0.0, 0.8}) {
      const double r2 = x * x + y * y;
      const double radial = (1 + k1 * r2 + k2 * std::pow(r2, 2) + k3 * std::pow(r2, 3)) /
                            (1 + k4 * r2 + k5 * std::pow(r2, 2) + k6 * std::pow(r2, 3));
      double xd = 0, yd = 0;
      ASSERT_TRUE(lens.distort(x, y, xd, yd));
      EXPECT_NEAR(xd, x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), 1e-14);
      EXPECT_NEAR(yd, y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y, 1e-14);
    }
}

TEST(Lens, FollowsTheFisheyeModel) {
  const Lens lens({Distortion::Model::fisheye, {0.05, -0.01, 0.002, -0.0003}}, 3);
  const double theta = 1.1, turn = 0.7;  // angle from the axis, and about it
  double xd = 0, yd = 0;
  ASSERT_TRUE(lens.distort(std::tan(theta) * std::cos(turn), std::tan(theta) * std::sin(turn), xd, yd));
  const double t2 = theta * theta;
  EXPECT_NEAR(std::hypot(xd, yd),
              theta * (1 + 0.05 * t2 - 0.01 * t2 * t2 + 0.002 * t2 * t2 * t2 - 0.0003 * t2 * t2 * t2 * t2), 1e-13);
  EXPECT_NEAR(std::atan2(yd, xd), turn, 1e-13);
  ASSERT_TRUE(lens.distort(0, 0, xd, yd));
  EXPECT_EQ(xd, 0);
  EXPECT_EQ(yd, 0);
}

TEST(Lens, EndsWhereThePolynomialFoldsBack) {
  // r (1 - 0.5 r^2) is largest at r^2 = 2/3.
  const Lens barrel(opencv({-0.5}), 3);
  EXPECT_NEAR(barrel.fold(), std::sqrt(2.0 / 3), 1e-9);
  double xd = 0, yd = 0;
  EXPECT_TRUE(barrel.distort(0.8, 0, xd, yd));
  EXPECT_FALSE(barrel.distort(0.83, 0, xd, yd));
  EXPECT_FALSE(barrel.distort(2, 2, xd, yd));
  // theta (1 - 0.3 theta^2) at theta^2 = 1/0.9.
  const Lens fisheye({Distortion::Model::fisheye, {-0.3}}, 10);
  EXPECT_NEAR(fisheye.fold(), std::tan(std::sqrt(1 / 0.9)), 1e-8);
  // The rational model has a pole at r = 1.
  const Lens pole(opencv({0, 0, 0, 0, 0, -1}), 2);
  EXPECT_LE(pole.fold(), 1.0);
  EXPECT_FALSE(pole.distort(1.5, 0, xd, yd));
  EXPECT_TRUE(std::isinf(Lens(opencv({0.3}), 5).fold()));
}

TEST(Lens, KnowsAPinhole) {
  EXPECT_TRUE(is_pinhole({}));
  EXPECT_TRUE(is_pinhole(opencv({})));
  EXPECT_FALSE(is_pinhole(opencv({0, 0, 0, 0, 0, 0, 0, 1e-3})));
  // A fisheye lens without parameters still distorts: theta_d = theta.
  EXPECT_FALSE(is_pinhole({Distortion::Model::fisheye, {}}));
}

}  // namespace
}  // namespace vsplat

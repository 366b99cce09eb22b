#include "model/views/seen_points.h"

#include <gtest/gtest.h>

namespace vsplat {
namespace {

Camera camera() {
  Camera out;
  out.width = 80, out.height = 40;
  out.fx = 100, out.fy = 50, out.cx = 30, out.cy = 20;
  out.w2c(2, 3) = 2;
  return out;
}

TEST(SeenPoints, APointIsAtItsPixelAndDepth) {
  const auto at = seen_at(camera(), {0.5, -0.25, 3});
  ASSERT_TRUE(at);
  EXPECT_NEAR((*at - Eigen::Vector3d(40, 17.5, 5)).norm(), 0, 1e-12);
}

TEST(SeenPoints, WhatIsBehindOrBesideIsNotSeen) {
  EXPECT_FALSE(seen_at(camera(), {0, 0, -3}));
  EXPECT_FALSE(seen_at(camera(), {0, 0, -2}));
  EXPECT_FALSE(seen_at(camera(), {3, 0, 3}));
  EXPECT_FALSE(seen_at(camera(), {0, 5, 3}));
}

std::vector<ColoredPoint> points(int good, int seen_twice, int wrong) {
  std::vector<ColoredPoint> out;
  out.reserve(static_cast<std::size_t>(good) + static_cast<std::size_t>(seen_twice) + static_cast<std::size_t>(wrong));
  for (int i = 0; i < good; ++i) out.push_back({{0, 0, 1}, {}, 2.0, 3});
  for (int i = 0; i < seen_twice; ++i) out.push_back({{0, 0, 2}, {}, 0.1, 2});
  for (int i = 0; i < wrong; ++i) out.push_back({{0, 0, 3}, {}, 2.1, 9});
  return out;
}

TEST(SeenPoints, UnreliableOnesAreLeftOutUnlessFewAreLeft) {
  const auto kept = [](std::vector<ColoredPoint> all) {
    keep_reliable(all);
    return all.size();
  };
  EXPECT_EQ(kept(points(100, 50, 7)), 100U);
  EXPECT_EQ(kept(points(29, 50, 0)), 79U);
  EXPECT_EQ(kept(points(30, 50, 0)), 30U);
  EXPECT_EQ(kept(points(40, 400, 0)), 440U);
  EXPECT_EQ(kept({}), 0U);
}

}  // namespace
}  // namespace vsplat

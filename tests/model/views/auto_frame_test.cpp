#include "model/views/auto_frame.h"

#include "model/views/pose_check.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using test::expect_error;

// The bounding box of a ball's outline in a picture, from points on the ball.
MaskExtent outline(const Camera& camera, const Vector3d& centre, double radius) {
  MaskExtent out{1e9, 1e9, -1e9, -1e9};
  for (int i = 0; i < 4000; ++i) {
    const double z = 1 - 2 * (i + 0.5) / 4000, a = 2.399963 * i, r = std::sqrt(1 - z * z);
    const auto at = project_to_picture(camera, centre + radius * Vector3d(r * std::cos(a), r * std::sin(a), z));
    out = {std::min(out.x0, at->x()), std::min(out.y0, at->y()), std::max(out.x1, at->x()), std::max(out.y1, at->y())};
  }
  return out;
}

TEST(AutoFrame, CentreFromOpticalAxes) {
  const Vector3d centre(3, -2, 5);
  EXPECT_LT((auto_frame(test::ring(7, centre)).placement.centre - centre).norm(),
            0.02);  // the principal point is off by 3 px
  EXPECT_LT((auto_frame(test::ring(20, centre, 2, 0.3, 10)).placement.centre - centre).norm(), 0.1);
}

TEST(AutoFrame, OneThatLooksElsewhereCountsLittle) {
  const Vector3d centre(3, -2, 5);
  std::vector<Camera> cameras = test::ring(12, centre);
  const Vector3d right = auto_frame(cameras).placement.centre;
  cameras[4].w2c = look_at(cameras[4].centre(), centre + Vector3d(0, 5, 0), {0, -1, 0});
  EXPECT_LT((auto_frame(cameras).placement.centre - right).norm(), 0.02);
}

TEST(AutoFrame, FarFromTheOriginItIsAsGood) {
  const Vector3d far(1e7, -3e7, 2e7);
  std::vector<Camera> cameras = test::ring(7, {3, -2, 5}, 2, 0.3, 4);
  const EstimatedPlacement near = auto_frame(cameras);
  for (Camera& c : cameras) c.w2c.topRightCorner<3, 1>() -= c.w2c.topLeftCorner<3, 3>() * far;
  const EstimatedPlacement found = auto_frame(cameras);
  EXPECT_LT((found.placement.centre - far - near.placement.centre).norm(), 1e-6);
  EXPECT_NEAR(found.placement.edge, near.placement.edge, 1e-6);
}

TEST(AutoFrame, EdgeFromDistanceAndFieldOfView) {
  const EstimatedPlacement found = auto_frame(test::ring(8, {1, 1, 1}, 4));
  EXPECT_NEAR(found.placement.edge, 4 * std::sqrt(640.0 / 800 * 480 / 790) / 1.5, 0.02);
  EXPECT_NE(found.from.find("optical axes of 8 views"), std::string::npos) << found.from;
  EXPECT_NE(found.from.find("median distance 4"), std::string::npos) << found.from;
}

TEST(AutoFrame, CentreAndEdgeFromMasks) {
  const Vector3d ball(0.3, 0.1, -0.2);  // away from where the cameras look
  const std::vector<Camera> cameras = test::ring(8, {0, 0, 0}, 4);
  std::vector<std::optional<MaskExtent>> masks;
  for (const Camera& c : cameras) masks.push_back(outline(c, ball, 0.4));
  masks[3].reset();  // nothing is visible
  const EstimatedPlacement found = auto_frame(cameras, masks);
  EXPECT_LT((found.placement.centre - ball).norm(), 0.02);
  EXPECT_NEAR(found.placement.edge, 1.2 * 0.8, 0.02);
  EXPECT_NE(found.from.find("7 masks"), std::string::npos) << found.from;
  EXPECT_EQ(auto_frame(cameras, masks, Vector3d(0, 0, 0)).placement.centre, Vector3d(0, 0, 0));
}

TEST(AutoFrame, TheCubeReachesNoCamera) {
  std::vector<Camera> cameras = test::ring(5, {0, 0, 0}, 2);
  for (Camera& c : cameras) c.fx = c.fy = 150;  // a field of view of 130 degrees
  const EstimatedPlacement found = auto_frame(cameras);
  EXPECT_NE(found.from.find("smaller"), std::string::npos) << found.from;
  EXPECT_NO_THROW(check_cube_is_in_front(place_views(cameras, found.placement, "rotate").cameras, {}));
}

TEST(AutoFrame, ParallelAxesMeetNowhere) {
  expect_error(Status::input, {"one view", "with center and scale"}, [] { auto_frame(test::ring(1)); });
  std::vector<Camera> cameras = test::ring(3);
  cameras[1] = cameras[2] = cameras[0];
  cameras[1].w2c(0, 3) += 1;
  expect_error(Status::input, {"parallel", "with center and scale"}, [&] { auto_frame(cameras); });
  EXPECT_GT(auto_frame(cameras, {}, Vector3d(0, 0, 0)).placement.edge, 0);  // with a given centre nothing is uncertain
  expect_error(Status::usage, {"no camera"}, [] { auto_frame({}); });
}

TEST(MaskExtent, HoldsTheObjectButNoStrayPixels) {
  Image mask(200, 100, 1);
  EXPECT_FALSE(mask_extent(mask));
  for (int y = 20; y < 70; ++y)
    for (int x = 30; x < 150; ++x) *mask.at(x, y) = 1;
  for (const auto& [x, y] : {std::pair{0, 0}, std::pair{199, 99}, std::pair{199, 3}}) *mask.at(x, y) = 1;
  const auto box = mask_extent(mask);
  ASSERT_TRUE(box);
  EXPECT_EQ(box->x0, 30);
  EXPECT_EQ(box->y0, 20);
  EXPECT_EQ(box->x1, 150);
  EXPECT_EQ(box->y1, 70);
  Image rgba(3, 2, 4);
  rgba.at(1, 1)[3] = 0.6f;  // the alpha of a picture
  rgba.at(0, 0)[0] = 1;
  ASSERT_TRUE(mask_extent(rgba));
  EXPECT_EQ(mask_extent(rgba)->x0, 1);
  EXPECT_EQ(mask_extent(rgba)->x1, 2);
  EXPECT_FALSE(mask_extent(Image()));
}

}  // namespace
}  // namespace vsplat

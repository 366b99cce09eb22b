#include "model/views/placement.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using test::expect_error;

std::vector<Camera> three_cameras() {
  const double q[3][4] = {{0.5, 0.5, -0.5, 0.5}, {0.8, 0.6, 0, 0}, {0.6, 0, 0, -0.8}};
  const double t[3][3] = {{1.5, -0.25, 2}, {-3, 0.5, 1}, {0.125, 4, -2}};
  std::vector<Camera> out(3);
  for (int i = 0; i < 3; ++i) {
    Eigen::Matrix4d c2w = Eigen::Matrix4d::Identity();
    c2w.topLeftCorner<3, 3>() = Eigen::Quaterniond(q[i][0], q[i][1], q[i][2], q[i][3]).toRotationMatrix();
    c2w.topRightCorner<3, 1>() << t[i][0], t[i][1], t[i][2];
    out[i].w2c = c2w.inverse();
  }
  return out;
}

// The inverse of the reference's `rebase(place(c2w, [0.5, -1, 0.25], 2.5), how)`.
constexpr double rotated[3][12] = {
    {1.0, 0.0, 0.0, -0.7, 0.0, 1.0, 0.0, 0.4, 0.0, 0.0, 1.0, 0.3},
    {0.0, -1.0, 0.0, 1.4, 0.96, 0.0, -0.28, -0.456, 0.28, 0.0, 0.96, 0.492},
    {0.0, 0.28, 0.96, 1.878, 0.0, -0.96, 0.28, 0.704, 1.0, 0.0, 0.0, 0.9},
};
constexpr double moved[3][12] = {
    {1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.860232526704263},
    {0.0, -1.0, 0.0, 1.8, 0.96, 0.0, -0.28, 0.059134892522806, 0.28, 0.0, 0.96, 1.225823225636092},
    {0.0, 0.28, 0.96, 2.303823225636092, 0.0, -0.96, 0.28, 1.244865107477194, 1.0, 0.0, 0.0, 1.6},
};

void expect_pose(const Camera& camera, const double* want) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c) EXPECT_NEAR(camera.w2c(r, c), want[4 * r + c], 1e-14) << r << " " << c;
}

TEST(Placement, RebaseIsThatOfTheReference) {
  const Placement cube{{0.5, -1, 0.25}, 2.5};
  const PlacedViews rotate = place_views(three_cameras(), cube, "rotate"),
                    move = place_views(three_cameras(), cube, "move");
  for (int i = 0; i < 3; ++i) expect_pose(rotate.cameras[i], rotated[i]), expect_pose(move.cameras[i], moved[i]);
}

TEST(Placement, TheWayBackLeadsToTheUsersWorld) {
  const std::vector<Camera> cameras = three_cameras();
  const Placement cube{{0.5, -1, 0.25}, 2.5};
  for (const char* how : {"rotate", "move"}) {
    const PlacedViews placed = place_views(cameras, cube, how);
    const Vector3d x(0.2, -0.4, 0.3), world = placed.to_world.apply(x);
    for (int i = 0; i < 3; ++i) {
      const Vector3d seen = (placed.cameras[i].w2c * x.homogeneous()).head<3>();
      const Vector3d there = (cameras[i].w2c * world.homogeneous()).head<3>();
      EXPECT_LT((cube.edge * seen - there).norm(), 1e-13) << how;
      EXPECT_LT((placed.to_world.apply(placed.cameras[i].centre()) - cameras[i].centre()).norm(), 1e-13) << how;
      EXPECT_LT((to_frame(placed.cameras[i], placed.to_world.inverse()).w2c - cameras[i].w2c).norm(), 1e-13) << how;
    }
  }
  EXPECT_EQ(place_views(cameras, cube, "rotate").to_world.apply(Vector3d::Zero()), cube.centre);
  expect_error(Status::usage, {"rebase is turn"}, [&] { place_views(cameras, cube, "turn"); });
  expect_error(Status::usage, {"no camera"}, [&] { place_views({}, cube, "rotate"); });
}

TEST(Placement, KeepsItsDigitsFarFromTheOrigin) {
  std::vector<Camera> near = test::ring(3), far = test::ring(3, {1e6, -2e6, 3e6});
  const PlacedViews a = place_views(near, {{0, 0, 0}, 1}, "rotate"),
                    b = place_views(far, {{1e6, -2e6, 3e6}, 1}, "rotate");
  for (int i = 0; i < 3; ++i) EXPECT_LT((a.cameras[i].w2c - b.cameras[i].w2c).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(Placement, CentreAndEdgeComeEachFromTheFirstThatKnows) {
  int asked = 0;
  const auto estimate = [&](const std::optional<Vector3d>& centre) {
    ++asked;
    return EstimatedPlacement{{centre.value_or(Vector3d(7, 8, 9)), 3}, "looked"};
  };
  const Vector3d listed(1, 2, 3);
  auto got = choose_placement({}, listed, 0.75, estimate).placement;
  EXPECT_EQ(got.centre, listed);
  EXPECT_EQ(got.edge, 1.5);
  got = choose_placement({Vector3d(4, 5, 6), {}, false}, listed, 0.75, estimate).placement;
  EXPECT_EQ(got.centre, Vector3d(4, 5, 6));
  EXPECT_EQ(got.edge, 1.5);
  got = choose_placement({Vector3d(4, 5, 6), 2.0, false}, {}, {}, estimate).placement;
  EXPECT_EQ(got.centre, Vector3d(4, 5, 6));
  EXPECT_EQ(got.edge, 2);
  EXPECT_EQ(asked, 0) << "nothing is left to estimate";
  // Values that the list does not state are estimated without a request.
  const ChosenPlacement unlisted = choose_placement({}, {}, {}, estimate);
  EXPECT_EQ(unlisted.placement.centre, Vector3d(7, 8, 9));
  EXPECT_EQ(unlisted.placement.edge, 3);
  for (const char* words : {"(7, 8, 9) (estimated)", "3 (estimated)", "looked"})
    EXPECT_NE(unlisted.found.find(words), std::string::npos) << unlisted.found;
  got = choose_placement({}, listed, {}, estimate).placement;
  EXPECT_EQ(got.centre, listed);
  EXPECT_EQ(got.edge, 3);
  got = choose_placement({}, {}, 0.75, estimate).placement;
  EXPECT_EQ(got.centre, Vector3d(7, 8, 9));
  EXPECT_EQ(got.edge, 1.5);
  EXPECT_EQ(asked, 3);
  // With auto_frame, values that the list states are estimated, too.
  const ChosenPlacement estimated = choose_placement({{}, 2.0, true}, listed, 0.75, estimate);
  EXPECT_EQ(estimated.placement.centre, Vector3d(7, 8, 9));
  EXPECT_EQ(estimated.placement.edge, 2);
  got = choose_placement({Vector3d(4, 5, 6), {}, true}, listed, 0.75, estimate).placement;
  EXPECT_EQ(got.centre, Vector3d(4, 5, 6));
  EXPECT_EQ(got.edge, 3);
  EXPECT_EQ(asked, 5);
  for (const double edge : {0.0, -1.0, std::nan("")})
    expect_error(Status::usage, {"edge"}, [&] { choose_placement({{}, edge, false}, {}, {}, estimate); });
  expect_error(Status::usage, {"centre"}, [&] {
    choose_placement({Vector3d(0, std::nan(""), 0), {}, false}, {}, {}, estimate);
  });
}

}  // namespace
}  // namespace vsplat

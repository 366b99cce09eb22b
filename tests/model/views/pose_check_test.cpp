#include "model/views/pose_check.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "model/views/auto_frame.h"
#include "tests/support/posed_views.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using test::expect_error;

const Eigen::Matrix4d flip = Eigen::Vector4d(1, -1, -1, 1).asDiagonal();

std::vector<Camera> changed(std::vector<Camera> cameras,
                            const std::function<Eigen::Matrix4d(const Eigen::Matrix4d&)>& w2c) {
  for (Camera& c : cameras) c.w2c = w2c(c.w2c);
  return cameras;
}

// A rig for which only the swap that was made brings the centre into all pictures.
std::vector<Camera> rig() {
  std::vector<Camera> out = test::ring(6, {0.5, 0.2, -0.4}, 3, 0.4, 4);
  Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
  turn.topLeftCorner<3, 3>() = Eigen::AngleAxisd(0.8, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  turn.topRightCorner<3, 1>() << 0.4, -0.9, 1.1;
  for (Camera& c : out) c.w2c = c.w2c * turn;
  return out;
}
ChosenPlacement cube() {
  const auto cameras = rig(), plain = test::ring(6, {0.5, 0.2, -0.4}, 3, 0.4, 4);
  return {{(cameras[0].w2c.inverse() * plain[0].w2c * Vector3d(0.5, 0.2, -0.4).homogeneous()).head<3>(), 1.0}, ""};
}

TEST(PoseCheck, RightPosesPass) {
  test::Warnings warnings;
  for (const auto convention :
       {PoseConvention::opengl_c2w, PoseConvention::opencv_w2c, PoseConvention::opencv_position})
    check_centre_is_seen(rig(), convention, cube());
  EXPECT_TRUE(warnings.all.empty());
}

TEST(PoseCheck, MissingTheCentreByManyDegreesIsNoError) {
  test::Warnings warnings;
  check_centre_is_seen(test::ring(8, {0, 0, 0}, 3, 0.2, 15), PoseConvention::opencv_w2c, {{{0, 0, 0}, 1}, ""});
  EXPECT_TRUE(warnings.all.empty());
}

TEST(PoseCheck, NamesTheSwapInTransformsJson) {  // read as c2w = L flip, where L is the file's matrix
  const auto convention = PoseConvention::opengl_c2w;
  const auto read = [](const Eigen::Matrix4d& listed) -> Eigen::Matrix4d { return (listed * flip).inverse(); };
  expect_error(Status::input, {"OpenCV axes (y down, z forward) where", "(force continues"}, [&] {
    check_centre_is_seen(changed(rig(), [&](const auto& w2c) { return read(w2c.inverse()); }), convention, cube(),
                         false);
  });
  expect_error(Status::input, {"world-to-camera matrices (w2c) where"}, [&] {
    check_centre_is_seen(changed(rig(), [&](const auto& w2c) { return read(flip * w2c); }), convention, cube());
  });
  expect_error(Status::input, {"world-to-camera matrices (w2c) with OpenCV axes"}, [&] {
    check_centre_is_seen(changed(rig(), [&](const auto& w2c) { return read(w2c); }), convention, cube());
  });
}

TEST(PoseCheck, NamesTheSwapInOpenCvFormats) {  // read as w2c = L
  const auto convention = PoseConvention::opencv_w2c;
  expect_error(Status::input, {"OpenGL axes (y up, -z forward) where"}, [&] {
    check_centre_is_seen(changed(rig(), [](const auto& w2c) { return flip * w2c; }), convention, cube());
  });
  expect_error(Status::input, {"camera-to-world matrices (c2w) where"}, [&] {
    check_centre_is_seen(changed(rig(), [](const auto& w2c) { return w2c.inverse(); }), convention, cube());
  });
  expect_error(Status::input, {"camera-to-world matrices (c2w) with OpenGL axes"}, [&] {
    check_centre_is_seen(changed(rig(), [](const auto& w2c) { return w2c.inverse() * flip; }), convention, cube());
  });
}

// The cube as estimated from these cameras; a swap moves it.
ChosenPlacement estimated(std::span<const Camera> cameras) {
  return {{where_axes_meet(cameras).value(), 1.0}, "", true};
}

TEST(PoseCheck, NamesTheSwapOfAnEstimatedCube) {
  test::Warnings warnings;
  for (const Vector3d& centre : {Vector3d(0, 0, 0), Vector3d(0.5, 0.2, -0.4), Vector3d(3, -1, 2)})
    for (const int count : {3, 4, 12}) {
      // Each camera looks slightly past the centre, since the axes of real photographs never meet in a point.
      const std::vector<Camera> right = test::ring(count, centre, 3, 0.4, 2);
      check_centre_is_seen(right, PoseConvention::opencv_w2c, estimated(right));
      EXPECT_EQ(poses_that_meet(right, PoseConvention::opencv_w2c), "");
      const auto inverted = changed(right, [](const auto& w2c) { return w2c.inverse(); });
      const auto other_axes = changed(right, [](const auto& w2c) { return flip * w2c; });
      const std::string text = fmt::format("{} about {}", count, to_text(centre));
      EXPECT_NE(poses_that_meet(inverted, PoseConvention::opencv_w2c).find("camera-to-world matrices (c2w) where"),
                std::string::npos)
          << text;
      expect_error(
          Status::input,
          {"behind", "do not meet in front of them", "camera-to-world matrices (c2w) where", "correct the poses"},
          [&] { check_centre_is_seen(inverted, PoseConvention::opencv_w2c, estimated(inverted)); });
      expect_error(Status::input, {"do not meet in front of them", "OpenGL axes (y up, -z forward) where"},
                   [&] { check_centre_is_seen(other_axes, PoseConvention::opencv_w2c, estimated(other_axes)); });
      // In a transforms.json: world-to-camera where camera-to-world is expected.
      const auto in_json =
          changed(right, [](const auto& w2c) -> Eigen::Matrix4d { return (flip * w2c * flip).inverse(); });
      EXPECT_NE(poses_that_meet(in_json, PoseConvention::opengl_c2w).find("world-to-camera matrices (w2c) where"),
                std::string::npos)
          << text;
    }
  EXPECT_EQ(warnings.text(), "");
  // A requested centre does not move with a swap.
  const auto inverted = changed(test::ring(6, {3, -1, 2}), [](const auto& w2c) { return w2c.inverse(); });
  expect_error(Status::input, {"no swap"}, [&] {
    check_centre_is_seen(inverted, PoseConvention::opencv_w2c, {{{50, 0, 0}, 1}, ""});
  });
}

TEST(PoseCheck, WarnsWhereAxesMeetBadlyAndOtherPosesWell) {
  test::Warnings warnings;
  // An arc of wide lenses: a point far in front of them is in all pictures.
  std::vector<Camera> cameras = test::ring(24, {3, -1, 2}, 3, 0.4);
  cameras.resize(6);
  cameras = changed(cameras, [](const auto& w2c) { return w2c.inverse(); });
  Vector3d before = Vector3d::Zero();
  for (Camera& c : cameras) c.fx = c.fy = 1, before += 100 * c.w2c.row(2).head<3>().transpose();
  check_centre_is_seen(cameras, PoseConvention::opencv_w2c, {{before, 1}, "", true});
  EXPECT_NE(warnings.text().find("camera-to-world matrices (c2w) where"), std::string::npos) << warnings.text();
}

TEST(PoseCheck, OnePlaceIsReportedFarFromTheOriginToo) {
  test::Warnings warnings;
  const Vector3d far(482345.125, 5456789.5, 212.75);
  warn_of_unlikely_cameras("set", test::ring(4, far));
  warn_of_unlikely_cameras("set", test::ring(4));
  warn_of_unlikely_cameras("set", test::ring(4, Vector3d(0, 0, 300)));
  EXPECT_EQ(warnings.text(), "") << "a ring of two units";
  for (const double apart : {1e-9, 1e-6, 1e-3}) {
    std::vector<Camera> cameras(4, test::ring(1)[0]);
    for (std::size_t i = 0; i < cameras.size(); ++i) cameras[i].w2c(0, 3) += apart * static_cast<double>(i) / 3;
    warnings.all.clear();
    warn_of_unlikely_cameras("set", cameras);
    EXPECT_NE(warnings.text().find("nearly the same pose"), std::string::npos) << apart;
  }
  for (const Vector3d& at : {far, Vector3d(0, 0, 0), Vector3d(0, 2e-6, 0)}) {
    std::vector<Camera> cameras = test::ring(4, at);
    for (Camera& c : cameras) c.w2c.topRightCorner<3, 1>() = -c.w2c.topLeftCorner<3, 3>() * at;
    warnings.all.clear();
    warn_of_unlikely_cameras("set", cameras);
    EXPECT_NE(warnings.text().find("at one place"), std::string::npos) << at;
    for (Camera& c : cameras) c.w2c = cameras[0].w2c;
    warnings.all.clear();
    warn_of_unlikely_cameras("set", cameras);
    EXPECT_NE(warnings.text().find("the same pose"), std::string::npos) << at;
  }
}

TEST(PoseCheck, PrincipalPointsOutsideThePicture) {
  std::vector<Camera> cameras = test::ring(4);
  cameras[0].cx = 0, cameras[0].cy = cameras[0].height;  // at its border
  test::Warnings warnings;
  warn_of_unlikely_cameras("set", cameras);
  EXPECT_EQ(warnings.text(), "");
  cameras[1].cx = -1;
  cameras[2].cy = cameras[2].height + 0.5;
  warn_of_unlikely_cameras("set", cameras);
  EXPECT_NE(warnings.text().find("of 2 of 4 views lies outside the picture"), std::string::npos) << warnings.text();
}

TEST(PoseCheck, NamesNoSwapWhereNoneHelps) {
  expect_error(Status::input,
               {"behind 3 and outside the picture of 2 of 6", "no swap", "give center and scale, or auto_frame"}, [] {
                 auto cameras = test::ring(6);
                 check_centre_is_seen(cameras, PoseConvention::opencv_w2c, {{{0, 0, 40}, 1}, ""});
               });
}

TEST(PoseCheck, ForceAndMinoritiesWarn) {
  test::Warnings warnings;
  const auto wrong = changed(rig(), [](const auto& w2c) { return flip * w2c; });
  check_centre_is_seen(wrong, PoseConvention::opencv_w2c, cube(), true);
  ASSERT_EQ(warnings.all.size(), 1U);
  EXPECT_NE(warnings.all[0].find("behind 6"), std::string::npos);
  auto cameras = test::ring(6);
  for (int i = 0; i < 3; ++i) cameras[i].w2c = look_at(cameras[i].centre(), 2 * cameras[i].centre(), {0, -1, 0});
  check_centre_is_seen(cameras, PoseConvention::opencv_w2c, {});
  EXPECT_EQ(warnings.all.size(), 2U);  // half of them is not a majority
  cameras[3] = cameras[2];
  expect_error(Status::input, {"behind 4"}, [&] { check_centre_is_seen(cameras, PoseConvention::opencv_w2c, {}); });
}

TEST(PoseCheck, CornersMustBeInFront) {
  const auto placed = [](double edge) {
    return place_views(test::ring(5, {0, 0, 0}, 2), {{0, 0, 0}, edge}, "rotate").cameras;
  };
  EXPECT_NO_THROW(check_cube_is_in_front(placed(2.3), {{0, 0, 0}, 2.3}));
  const std::string text = test::refusal([&] { check_cube_is_in_front(placed(3), {{0, 0, 0}, 3}); }, Status::input);
  EXPECT_NE(text.find("view 1 (1.png)"), std::string::npos) << text;
  const double advised = std::stod(text.substr(text.find("under ") + 6));
  EXPECT_NO_THROW(check_cube_is_in_front({placed(0.999 * advised).data() + 1, 1}, {}));
  EXPECT_THROW(check_cube_is_in_front({placed(1.001 * advised).data() + 1, 1}, {}), Error);
  auto cameras = placed(1);
  cameras[2].w2c = flip * cameras[2].w2c;
  expect_error(Status::input, {"view 2 (2.png)", "its centre too"}, [&] { check_cube_is_in_front(cameras, {}); });
}

TEST(PoseCheck, ProjectsThroughTheLens) {
  Camera c;
  c.width = c.height = 200;
  c.fx = 100, c.fy = 110, c.cx = 90, c.cy = 105;
  EXPECT_LT((*project_to_picture(c, {0.2, -0.4, 2}) - Eigen::Vector2d(100, 83)).norm(), 1e-12);
  EXPECT_FALSE(project_to_picture(c, {0.2, -0.4, 0}));
  EXPECT_FALSE(project_to_picture(c, {0, 0, -1}));
  c.distortion.model = Distortion::Model::opencv;
  c.distortion.k[0] = 0.1;
  EXPECT_LT((*project_to_picture(c, {1, 0, 2}) - Eigen::Vector2d(90 + 50 * 1.025, 105)).norm(), 1e-12);
  c.distortion = {};
  c.distortion.model = Distortion::Model::fisheye;
  c.distortion.k[0] = 0.1;
  const double theta = std::atan(0.5);
  EXPECT_LT(
      (*project_to_picture(c, {1, 0, 2}) - Eigen::Vector2d(90 + 100 * theta * (1 + 0.1 * theta * theta), 105)).norm(),
      1e-12);
  EXPECT_LT((*project_to_picture(c, {0, 0, 2}) - Eigen::Vector2d(90, 105)).norm(), 1e-12);
}

}  // namespace
}  // namespace vsplat

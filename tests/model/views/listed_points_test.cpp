#include "model/views/listed_points.h"

#include <Eigen/Geometry>

#include "model/base/scene.h"
#include "model/views/input.h"
#include "tests/support/posed_views.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using test::expect_error;
using test::ViewFolder;

std::string images_text(const std::vector<Camera>& cameras) {
  std::string out;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Eigen::Matrix4d& m = cameras[i].w2c;
    const Eigen::Quaterniond q(m.topLeftCorner<3, 3>());
    out += fmt::format("{} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} 1 {}.png\n\n", i + 1, q.w(), q.x(),
                       q.y(), q.z(), m(0, 3), m(1, 3), m(2, 3), i);
  }
  return out;
}

// A ball of points about `centre`.
std::string points_text(const Vector3d& centre) {
  std::string out;
  for (int i = 0; i < 200; ++i) {
    const double z = 1 - 2 * (i + 0.5) / 200, a = 2.399963 * i, r = std::sqrt(1 - z * z);
    const Vector3d p = centre + 0.3 * Vector3d(r * std::cos(a), r * std::sin(a), z);
    out += fmt::format("{} {:.17g} {:.17g} {:.17g} 10 20 30 0.5 1 0 2 0 3 0\n", i + 1, p.x(), p.y(), p.z());
  }
  return out;
}

void write_model(const ViewFolder& folder, const std::string& where, const std::vector<Camera>& cameras,
                 const Vector3d& centre) {
  folder.write(where + "/cameras.txt", "1 PINHOLE 640 480 800 790 322 237\n");
  folder.write(where + "/images.txt", images_text(cameras));
  folder.write(where + "/points3D.txt", points_text(centre));
}

ViewSet listed(const ViewFolder& folder, std::vector<Camera> cameras) {
  ViewSet out;
  out.source = folder.touch("transforms.json");
  for (Camera& c : cameras) {
    ListedView& view = out.views.emplace_back();
    view.name = "images/" + c.file;
    view.camera = c;
  }
  return out;
}

std::vector<Camera> after_move(std::vector<Camera> cameras, const Similarity& move) {
  for (Camera& c : cameras) {
    const Vector3d eye = move.apply(c.centre());
    c.w2c.topLeftCorner<3, 3>() = (c.w2c.topLeftCorner<3, 3>() * move.rotation.transpose()).eval();
    c.w2c.topRightCorner<3, 1>() = -c.w2c.topLeftCorner<3, 3>() * eye;
  }
  return cameras;
}

Vector3d mean(const ListedPoints& of) {
  Vector3d out = Vector3d::Zero();
  for (const ColoredPoint& p : of.points) out += p.position / static_cast<double>(of.points.size());
  return out;
}

TEST(ListedPoints, OfAColmapModelItsOwn) {
  const ViewFolder folder;
  write_model(folder, "sparse/0", test::ring(4), {1, 2, 3});
  const auto found = listed_points(read_views(folder.path(), {.need_pictures = false}));
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->placed);
  EXPECT_EQ(found->points.size(), 200U);
  EXPECT_LT((mean(*found) - Vector3d(1, 2, 3)).norm(), 0.01);
  std::filesystem::remove(folder / "sparse/0/points3D.txt");
  EXPECT_FALSE(listed_points(read_views(folder.path(), {.need_pictures = false})));
}

TEST(ListedPoints, OfAModelBesideTheListAreMovedIntoItsWorld) {
  const Similarity move{0.35, Eigen::AngleAxisd(1.1, Vector3d(1, 2, -1).normalized()).toRotationMatrix(), {4, -5, 6}};
  for (const char* where : {"sparse/0", "colmap/sparse/0", "colmap"}) {
    const ViewFolder folder;
    write_model(folder, where, test::ring(5, {1, 2, 3}), {1, 2, 3});
    const auto turned = listed_points(listed(folder, after_move(test::ring(5, {1, 2, 3}), move)));
    ASSERT_TRUE(turned) << where;
    EXPECT_TRUE(turned->placed);
    EXPECT_LT((mean(*turned) - move.apply({1, 2, 3})).norm(), 0.01) << where;
    // Points in the same world stay unchanged, to the bit.
    const auto same = listed_points(listed(folder, test::ring(5, {1, 2, 3})));
    ASSERT_TRUE(same);
    EXPECT_EQ(same->points[7].position, read_colmap_points(folder / where)[7].position);
  }
}

TEST(ListedPoints, OfOtherCamerasAreNone) {
  const ViewFolder folder;
  write_model(folder, "sparse/0", test::ring(5), {0, 0, 0});
  ViewSet set = listed(folder, test::ring(5));
  for (ListedView& view : set.views) view.name = "other-" + view.name.substr(7);
  const auto unknown = listed_points(set);
  ASSERT_TRUE(unknown);
  EXPECT_FALSE(unknown->placed) << "nothing tells where the model lies";
  set = listed(folder, test::ring(5));
  std::swap(set.views[0].camera.w2c, set.views[2].camera.w2c);
  expect_error(Status::input, {"sparse/0", "transforms.json", "same names"}, [&] { listed_points(set); });
}

TEST(ListedPoints, OfAPlyFile) {
  const ViewFolder folder;
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
  ViewSet set = listed(folder, test::ring(3));
  set.points = folder.write("sparse_pc.ply", head +
                                                 "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                                                 "end_header\n1 2 3 10 20 30\n-4 5 -6 255 0 1\n");
  const auto found = listed_points(set);
  ASSERT_TRUE(found);
  ASSERT_EQ(found->points.size(), 2U);
  EXPECT_EQ(found->points[1].position, Vector3d(-4, 5, -6));
  EXPECT_EQ(found->points[0].rgb, (std::array<std::uint8_t, 3>{10, 20, 30}));
  set.points = folder.write("grey.ply", head + "end_header\n1 2 3\n4 5 nan\n");
  expect_error(Status::input, {"grey.ply", "vertex 1", "z is NaN"}, [&] { listed_points(set); });
  set.points = folder.write("flat.ply",
                            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                            "end_header\n1 2\n");
  expect_error(Status::format, {"flat.ply", "no z"}, [&] { listed_points(set); });
}

// Photographs with only poses, as in a user's first command.
TEST(FindPlacement, EstimatesWhatTheListDoesNotSay) {
  const ViewFolder folder;
  const Vector3d looked_at(1, 2, 3), object(1.2, 2.1, 2.9);
  Photographs photographs{listed(folder, test::ring(4, looked_at)), {}};
  for (ListedView& view : photographs.set.views) {
    folder.write(view.name, "");
    view.picture = folder / view.name;
    write_png(view.picture.string(), Image(640, 480, 3));
  }
  const std::vector<int> all{0, 1, 2, 3};
  const ChosenPlacement by_axes = find_placement(photographs, all, {});
  EXPECT_LT((by_axes.placement.centre - looked_at).norm(), 0.05);
  EXPECT_NE(by_axes.found.find("optical axes of 4 views"), std::string::npos) << by_axes.found;
  write_model(folder, "sparse/0", test::ring(4, looked_at), object);
  const ChosenPlacement by_points = find_placement(photographs, all, {});
  EXPECT_LT((by_points.placement.centre - object).norm(), 0.02);
  EXPECT_NEAR(by_points.placement.edge, 0.6 * 1.05, 0.03);
  EXPECT_NE(by_points.found.find("of the 200 points"), std::string::npos) << by_points.found;
  // Points of another world are not used, and damaged ones cause a warning; placement continues without them.
  photographs.set.views[0].name = photographs.set.views[1].name = photographs.set.views[2].name = "images/x.png";
  EXPECT_EQ(find_placement(photographs, all, {}).placement.edge, by_axes.placement.edge);
  photographs.set = listed(folder, test::ring(4, looked_at));
  for (ListedView& view : photographs.set.views) view.picture = folder / view.name;
  folder.write("sparse/0/points3D.txt", "1 0 0 zero 1 2 3 0.5\n");
  const test::Warnings warnings;
  EXPECT_EQ(find_placement(photographs, all, {}).placement.edge, by_axes.placement.edge);
  EXPECT_NE(warnings.text().find("points3D.txt"), std::string::npos) << warnings.text();
  // A cube stated in the list is used as it is.
  photographs.set.aabb_center = Vector3d(1, 1, 1);
  photographs.set.aabb_half = 0.25;
  const ChosenPlacement by_list = find_placement(photographs, all, {});
  EXPECT_EQ(by_list.placement.centre, Vector3d(1, 1, 1));
  EXPECT_EQ(by_list.placement.edge, 0.5);
}

TEST(FindPlacement, OneViewIsTakenToShowTheOrigin) {
  const ViewFolder folder;
  Photographs photographs{listed(folder, test::ring(1)), {}};
  folder.write(photographs.set.views[0].name, "");
  photographs.set.views[0].picture = folder / photographs.set.views[0].name;
  write_png(photographs.set.views[0].picture.string(), Image(640, 480, 3));
  const std::vector<int> all{0};
  const ChosenPlacement found = find_placement(photographs, all, {});
  EXPECT_EQ(found.placement.centre, Vector3d::Zero());
  EXPECT_EQ(found.placement.edge, 1);
  EXPECT_NE(found.found.find("since all views show the origin"), std::string::npos) << found.found;
  photographs.set.views[0].camera.w2c(0, 3) = 50;  // looks past it
  expect_error(Status::input, {"one view", "with center and scale"}, [&] { find_placement(photographs, all, {}); });
}

}  // namespace
}  // namespace vsplat
